"""What moves across the way: slow down, wait or make room, by the closest approach predicted (control.md 7)."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, inf

from lfa.agents.avoidance.decision import Decision, Situation, decide
from lfa.agents.perception.obstacle_tracker import Feature
from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc

CLEARANCE_M = 0.6
"""From the robot's centre to the surface of what moves; nearer within the horizon is a conflict."""
HORIZON_S = 3.0
LOOK_S = 6.0
"""When nothing keeps the distance within the horizon, so far ahead is looked at which keeps most of it: what comes on
slowly from behind is not at a waiting robot yet when the horizon ends."""
STEP_S = 0.25
SLOW_SHARE = 0.4
BACK_MPS = AHEAD_MPS = 0.25
WAIT_S_MAX = 5.0
"""After so long what moves is gone round as if it stood."""
HOLD_S = 1.0
"""A robot takes less care only so long after the last conflict."""
CARE = {"slow": 0, "wait": 1, "ahead": 2, "back": 2}
WORTH_M = 0.1
"""Going out of the way, ahead or back, must win this much clearance over what is being done, or over waiting."""


class Crossing:
    """Gives way to what moves, for a bounded time."""

    def __init__(self) -> None:
        self.decision: Decision | None = None
        self._waiting_since: float | None = None
        self._held_until = 0.0
        self._near = inf
        """Of the last conflict."""
        self._impatient = False

    @property
    def patient(self) -> bool:
        """False once the longest wait is over: what moves is then gone round as if it stood."""
        return not self._impatient

    def give_way(self, moving: Sequence[Feature], pose: Pose2D, wanted: Twist, now: float) -> Twist:
        """`wanted`, or less of it. `moving` as of now, in `map` like `pose`."""
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
        """The least that keeps the distance; what keeps most of it when nothing does."""
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
    """Least distance [m] between the robot's centre and a surface within so long from now on.

    What is already that near and moves away is no conflict: only approaches count.
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
