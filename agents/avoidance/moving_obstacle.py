"""Avoidance of moving obstacles: slow down, wait or make room, by the predicted closest approach (control.md section
7).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, inf

from lfa.agents.avoidance.decision import Decision, Situation, decide
from lfa.agents.perception.obstacle_tracker import Feature
from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc

CLEARANCE_M = 0.6
"""Least distance [m] from the robot's centre to the surface of a moving obstacle; less within the horizon is a
conflict."""
HORIZON_S = 3.0
LOOK_S = 6.0
"""Prediction time [s] for choosing the action with the largest clearance when no action keeps `CLEARANCE_M` within the
horizon: an obstacle that comes slowly from behind has not reached a waiting robot at the end of the horizon."""
STEP_S = 0.25
SLOW_SHARE = 0.4
BACK_MPS = AHEAD_MPS = 0.25
WAIT_S_MAX = 5.0
"""Maximum waiting time [s]; afterwards a moving obstacle is driven around like a stationary one."""
HOLD_S = 1.0
"""Time [s] after the last conflict before a robot may choose a less careful action."""
CARE = {"slow": 0, "wait": 1, "ahead": 2, "back": 2}
WORTH_M = 0.1
"""Clearance [m] that driving ahead or back must win over the present action, or over waiting."""


class Crossing:
    """Give-way behaviour of one robot towards moving obstacles, for a bounded time."""

    def __init__(self) -> None:
        self.decision: Decision | None = None
        self._waiting_since: float | None = None
        self._held_until = 0.0
        self._near = inf
        """Closest approach [m] in the last conflict."""
        self._impatient = False

    @property
    def patient(self) -> bool:
        """False after the longest wait: a moving obstacle is then driven around like a stationary one."""
        return not self._impatient

    def give_way(self, moving: Sequence[Feature], pose: Pose2D, wanted: Twist, now: float) -> Twist:
        """Return `wanted`, or a slower or evading twist. `moving` holds as of now, in `map` like `pose`."""
        near = _closest(moving, pose, wanted)
        if near >= CLEARANCE_M and now >= self._held_until:
            self.decision, self._waiting_since, self._impatient = None, None, False
            return wanted
        self._near = near if near < CLEARANCE_M else self._near
        if self._waiting_since is None:
            self._waiting_since = now
        self._impatient = now - self._waiting_since > WAIT_S_MAX
        if self._impatient:
            self.decision = None
            return wanted
        action = "slow" if near >= CLEARANCE_M else self._less(moving, pose, wanted)
        if self.decision is None or CARE[action] >= CARE[self.decision.action] or now >= self._held_until:
            row = decide(Situation("moving", near, closest_m=min(near, self._near)))
            named = ("", "") if row is None else (row.name, row.updates)
            self.decision = Decision(action, near, 0.0, "moving", *named)
            self._held_until = now + HOLD_S if near < CLEARANCE_M else self._held_until
        return _done(self.decision.action, wanted)

    def _less(self, moving: Sequence[Feature], pose: Pose2D, wanted: Twist) -> str:
        """Return the least action that keeps the distance; if none does, the one that keeps most of it."""
        if _closest(moving, pose, _done("slow", wanted)) >= CLEARANCE_M:
            return "slow"
        if _closest(moving, pose, STILL) >= CLEARANCE_M:
            return "wait"
        kept = {action: _closest(moving, pose, _done(action, wanted), LOOK_S) for action in ("wait", "back", "ahead")}
        doing = "wait" if self.decision is None or self.decision.action not in kept else self.decision.action
        kept[doing] += WORTH_M
        return max(kept, key=lambda action: kept[action])


def _done(action: str, wanted: Twist) -> Twist:
    if action == "slow":
        return Twist(SLOW_SHARE * wanted.linear_x, SLOW_SHARE * wanted.angular_z)
    if action == "ahead":
        return Twist(max(wanted.linear_x, AHEAD_MPS), 0.0)
    return STILL if action == "wait" else Twist(-BACK_MPS, 0.0)


def _closest(moving: Sequence[Feature], pose: Pose2D, twist: Twist, within_s: float = HORIZON_S) -> float:
    """Return the least distance [m] between the robot's centre and an obstacle's surface within `within_s` [s] from
    now.

    Only approaches count: an obstacle that is already near and moves away is no conflict.
    """
    least = inf
    for feature in moving:
        first = hypot(feature.x - pose.x, feature.y - pose.y)
        for n in range(1, round(within_s / STEP_S) + 1):
            later = n * STEP_S
            there, (x, y) = along_arc(pose, twist, later), feature.at(later)
            apart = hypot(x - there.x, y - there.y)
            if apart < first:
                least = min(least, apart - feature.radius_m)
    return least
