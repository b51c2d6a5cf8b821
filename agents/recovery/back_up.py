"""Backing up: a robot that gave up a place drives back along its trail, as far as that is free, until it is out."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from math import hypot

from lfa.agents.avoidance.safety import SKIN_M
from lfa.agents.perception.scan import Point, free_along
from lfa.protocol.geometry import STILL, Pose2D, Twist, in_base

STEP_M, TRAIL_M = 0.1, 6.0
OUT_M = 1.6
"""Distance [m] driven backwards after which the robot counts as free."""
AHEAD_M = 0.4
BACK_MPS = 0.2
ROOM_M = 0.05


class BackUp:
    """Trail of one robot, and the way back along it once `begin` was called."""

    def __init__(self) -> None:
        self._trail: deque[Point] = deque(maxlen=round(TRAIL_M / STEP_M))
        self._left_m: float | None = None
        self._at: Point | None = None
        self.trap: Point | None = None
        """Position in `map` where the robot was stuck last."""

    @property
    def under_way(self) -> bool:
        return self._left_m is not None

    def keep(self, pose: Pose2D) -> None:
        """Extend the trail; call it in each control step without a back-up."""
        if not self._trail or hypot(pose.x - self._trail[-1][0], pose.y - self._trail[-1][1]) >= STEP_M:
            self._trail.append((pose.x, pose.y))

    def begin(self, pose: Pose2D) -> None:
        """Start backing up from `pose`."""
        self._left_m, self._at = OUT_M, (pose.x, pose.y)
        self.trap = self._at

    def end(self) -> None:
        """Give the back-up up: the robot drives on from where it is."""
        self._left_m = None

    def step(self, points: Sequence[Point], pose: Pose2D, radius_m: float) -> Twist | None:
        """Return the twist backwards along the trail; still while it is blocked; None when the robot is out."""
        if self._left_m is None or self._at is None:
            return None
        self._left_m -= hypot(pose.x - self._at[0], pose.y - self._at[1])
        self._at = pose.x, pose.y
        while self._trail and hypot(self._trail[-1][0] - pose.x, self._trail[-1][1] - pose.y) < AHEAD_M:
            self._trail.pop()
        if self._left_m <= 0.0 or not self._trail:
            self._left_m = None
            return None
        x, y = in_base(pose, self._trail[-1])
        reach = max(hypot(x, y), AHEAD_M)
        twist = Twist(-BACK_MPS, -BACK_MPS * 2.0 * y / (reach * reach))
        return twist if free_along(points, twist, radius_m + SKIN_M) > ROOM_M else STILL
