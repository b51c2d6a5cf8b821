"""Backing up: a robot that gave up a place drives back along its trail, as far as that is free, until it is out.

A narrow place bars the arc to its trail where the robot stands across it. It then turns its rear to the trail on the
spot, which a round body always can.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from math import atan2, cos, hypot, pi, sin

from lfa.agents.avoidance.safety import SKIN_M
from lfa.agents.perception.footprint import PolygonBody
from lfa.agents.perception.scan import Point, free_along
from lfa.protocol.geometry import STILL, Pose2D, Twist, in_base, wrap

STEP_M, TRAIL_M = 0.1, 6.0
LOOP_M = 0.2
"""Distance [m] from a place of its trail within which the robot is there again."""
OUT_M = 1.6
"""Distance [m] driven backwards after which the robot counts as free."""
AHEAD_M = 0.4
BACK_MPS = 0.2
ROOM_M = 0.05
TURN_PER_S, TURN_RADPS = 2.0, 0.8
"""Turn rate [1/s] per angle of the rear off its way, and at most [rad/s]."""
ALIGNED_RAD = 0.1
"""Angle [rad] of the rear off its way below which a robot drives and does not turn."""
ASIDE_RAD, ASIDE_STEP_RAD = 1.2, 0.15
"""Largest angle off the direct way within which another one is looked for, and the step between two: enough to get
round a corner; farther aside no way leads nearer."""
BEYOND_M = 1.0
"""Length [m] of the way back that is looked for where no trail is left."""


class BackUp:
    """Trail of one robot, and the way back along it once `begin` was called."""

    def __init__(self, footprint: PolygonBody | None = None) -> None:
        """Create a trail; `footprint` is None for a round body."""
        self._footprint = footprint
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
        trail, x, y = self._trail, pose.x, pose.y
        if trail and hypot(x - trail[-1][0], y - trail[-1][1]) < STEP_M:
            return
        near = [n for n, (px, py) in enumerate(trail) if -LOOP_M < x - px < LOOP_M and hypot(x - px, y - py) < LOOP_M]
        for _ in range(len(trail) - 1 - near[0] if near else 0):  # back where it was: the loop since then leads nowhere
            trail.pop()
        trail.append((x, y))

    def begin(self, pose: Pose2D, least_m: float = OUT_M) -> None:
        """Start backing up from `pose`, by `least_m` [m] or more."""
        self._left_m, self._at = max(OUT_M, least_m), (pose.x, pose.y)
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
        if self._footprint is None:
            free_m = free_along(points, twist, radius_m + SKIN_M)
        else:
            free_m = self._footprint.free_along(points, twist, SKIN_M)
        if x < 0.0 and free_m > ROOM_M:
            return twist
        return back_to(points, (x, y), radius_m)


def back_to(points: Sequence[Point], target: Point, radius_m: float) -> Twist:
    """Return the twist straight backwards on the way that ends nearest to `target` in `base_link`, or the turn of the
    rear there; still where none leads nearer.
    """
    direct_rad, left_m = wrap(atan2(target[1], target[0]) - pi), hypot(*target)
    reach_m, steps = left_m + radius_m + SKIN_M, round(ASIDE_RAD / ASIDE_STEP_RAD)
    near = [(x, y) for x, y in points if x * x + y * y < reach_m * reach_m]
    nearest_m = left_m - ROOM_M
    off_rad: float | None = None
    for n in sorted(range(-steps, steps + 1), key=abs):
        aside_rad = n * ASIDE_STEP_RAD
        c, s = cos(direct_rad + aside_rad), sin(direct_rad + aside_rad)
        turned = [(c * x + s * y, c * y - s * x) for x, y in near]
        free_m = free_along(turned, Twist(-1.0, 0.0), radius_m + SKIN_M, left_m)
        end_m = hypot(left_m - free_m * cos(aside_rad), free_m * sin(aside_rad))
        if free_m > ROOM_M and end_m < nearest_m:
            nearest_m, off_rad = end_m, wrap(direct_rad + aside_rad)
    if off_rad is None:
        return STILL
    if abs(off_rad) < ALIGNED_RAD:
        return Twist(-BACK_MPS, 0.0)
    return Twist(0.0, max(-TURN_RADPS, min(TURN_RADPS, TURN_PER_S * off_rad)))
