"""Behaviour of a robot that is stuck: it backs out of the place along its trail, and keeps out of it from then on."""

from __future__ import annotations

from collections import deque
from math import hypot, inf, pi

from lfa.agents.avoidance.decision import Action, Decision
from lfa.agents.avoidance.detour import Detour
from lfa.agents.avoidance.safety import SKIN_M
from lfa.agents.following.follower import Follower
from lfa.agents.perception.footprint import PolygonBody
from lfa.agents.perception.obstacle_model import TRAP_M, ObstacleModel
from lfa.agents.perception.scan import Point
from lfa.agents.recovery.back_up import BackUp
from lfa.agents.recovery.stuck_detector import StuckMonitor
from lfa.protocol.geometry import STILL, Pose2D, Twist
from lfa.protocol.mission import Mission

STANDS_S, STANDS_S_MAX = 10.0, 80.0
"""Time [s] for which a robot stands whose way back is barred; then it gives backing out up, and tries to follow. Each
time it doubles, up to a maximum."""
TRAPS_MAX = 16
"""Number of traps in which a robot stands and which it remembers; the oldest is forgotten."""


class BackOut:
    """Backing out of one robot; `detour` holds the present decision, and is shared with the other behaviours'."""

    def __init__(
        self, mission: Mission, follower: Follower, detour: Detour, obstacles: ObstacleModel, stuck: StuckMonitor
    ) -> None:
        self._mission = mission
        self._follower = follower
        self._detour = detour
        self._obstacles = obstacles
        self._stuck = stuck
        self._path = BackUp(PolygonBody.of(mission))
        self._clear_m = TRAP_M + mission.radius_m + SKIN_M
        """Distance [m] from a trap at which the robot stands clear of what is blocked there."""
        self._stands_since: float | None = None
        """Time [s] since which the way back is barred; None while it is not."""
        self._patience_s = STANDS_S
        self._traps: deque[Point] = deque(maxlen=TRAPS_MAX)
        """Traps in `map` to block once this robot is out of them."""
        self._blocked: deque[Point] = deque(maxlen=TRAPS_MAX)
        """Traps in `map` that are blocked."""

    @property
    def under_way(self) -> bool:
        return self._path.under_way

    def begin(self, pose: Pose2D) -> None:
        """Start backing out of the place in which the robot is stuck."""
        if self._stuck.reason is not None and not self._path.under_way:
            self._path.begin(pose, self._clear_m + SKIN_M)
            self._stands_since = None
            self._stuck.backing_out = True

    def keep(self, pose: Pose2D, now: float) -> None:
        """Extend the trail by which the robot would back out, and block the traps that it is out of. One that it has
        come into on a planned way encloses it no more.
        """
        if not self._path.under_way:
            self._path.keep(pose)
        for x, y in [trap for trap in self._traps if hypot(trap[0] - pose.x, trap[1] - pose.y) >= self._clear_m]:
            self._traps.remove((x, y))
            self._obstacles.avoid_trap(x, y, now)
            self._blocked.append((x, y))
        for x, y in [trap for trap in self._blocked if hypot(trap[0] - pose.x, trap[1] - pose.y) < TRAP_M]:
            self._blocked.remove((x, y))
            self._obstacles.enter_trap(x, y)
            self._traps.append((x, y))

    def step(self, points: list[Point], pose: Pose2D, wanted: Twist, last: Twist, now: float) -> Twist:
        """Return the twist backwards out of a trap, then block the trap; `wanted` once the robot is out, or has stood
        too long before what bars its way back: ahead there may be one now.
        """
        twist = self._path.step(points, pose, self._mission.radius_m)
        if twist != STILL:
            self._stands_since = None
        elif self._stands_since is None:
            self._stands_since = now
        gives_up = self._stands_since is not None and now - self._stands_since >= self._patience_s
        if twist is not None and not gives_up:
            action = Action.BACK if twist.linear_x else Action.BLOCKED
            self._detour.decision = Decision(action, inf, pi, "wall", "out of a trap")
            return twist
        self._stuck.out()
        self._detour.decision = None
        self._follower.rejoin(pose, last)
        self._path.end()
        self._patience_s = min(2.0 * self._patience_s, STANDS_S_MAX) if gives_up else STANDS_S
        if self._path.trap is not None and not gives_up:
            self.bar(self._path.trap)
        return wanted

    def bar(self, trap: Point) -> None:
        """Block `trap` as soon as this robot stands clear of it: the edge of what is blocked would enclose it.

        Not for an explorer: it plans on its map, and would be enclosed in a corner.
        """
        if self._mission.leading.motion != "explore" and trap not in (*self._traps, *self._blocked):
            self._traps.append(trap)
