"""Avoidance of moving obstacles: slow down, wait, or make room ahead, behind or to a side, by the predicted closest
approach (control.md section 7).

What crosses is let pass: slower or standing is enough. What comes along the robot's own way, from ahead or from behind,
meets it wherever it waits: then the motions of `EVASIONS` are compared by the distance that each would keep, as far as
the scan leaves them free.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import hypot, inf

from msgspec import Struct

from lfa.agents.avoidance.decision import Action, Decision, Situation, decide
from lfa.agents.avoidance.moving_points import AWAY_M
from lfa.agents.perception.obstacle_tracker import Feature
from lfa.agents.perception.scan import Point, free_along
from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc, slowed, wrap

CLEARANCE_M = 0.6
"""Least distance [m] from the robot's centre to the surface of a moving obstacle; less within the horizon is a
conflict."""
HORIZON_S = 4.0
LOOK_S = 6.0
"""Prediction time [s] for choosing the action with the largest clearance when no action keeps `CLEARANCE_M` within the
horizon: an obstacle that comes slowly from behind has not reached a waiting robot at the end of the horizon."""
STEP_S = 0.25
SLOW_SHARE, CRUISE_MPS = 0.4, 0.5
"""Share of the cruise speed [m/s] that a slowed robot drives at most. A share of what it wants would be taken again in
each step, since that grows from its last speed: it would crawl.
"""
WAIT_S_MAX = 5.0
"""Maximum waiting time [s]; afterwards a moving obstacle is driven around like a stationary one."""
SOON_S = 2.0
"""Time [s] ahead within which what comes on is given way to again, however long it was waited for."""
HOLD_S = 1.0
"""Time [s] after the last conflict before a robot may choose a less careful action."""
WORTH_M = 0.1
"""Clearance [m] that another evasion must win over the present action, or over waiting."""
BODY_M = 0.05
"""Clearance [m] to what stands that an evasion keeps beside the body."""
ROOM_S = 1.2
"""Time [s] for which an evasion has to be free of what stands."""
MATE_M, MATE_S, MATES_WITHIN_M = 0.15, 1.5, 2.0
"""Room [m] between two bodies, and time [s] ahead, that an evasion keeps from team-mates, which evade as well, and the
distance [m] of those that are looked at."""


class Evasion(Struct, frozen=True):
    """Motion out of the way: a bend of `turn_rad` [rad], then straight on, at `v_mps` [m/s]."""

    action: Action
    v_mps: float
    omega_radps: float = 0.0
    turn_rad: float = 0.0


EVASIONS = (
    Evasion(Action.WAIT, 0.0),
    Evasion(Action.RIGHT, 0.45, -0.9, 1.0),
    Evasion(Action.LEFT, 0.45, 0.9, 1.0),
    Evasion(Action.RIGHT, 0.25, -1.2, 1.5),
    Evasion(Action.LEFT, 0.25, 1.2, 1.5),
    Evasion(Action.AHEAD, 0.25),
    Evasion(Action.BACK, -0.25),
)
"""Of two that keep the same distance the first is taken: to the right first, as two that meet both do."""
DRIVEN_M = 0.3
"""Clearance [m] that backing off must keep beyond the others: what comes after a robot that backs off drives it on."""
CLOSE_M, CLOSE_S = 0.35, 1.0
"""Room [m] to what comes on below which the way that it means to pass by does not count any more, for it may turn, and
the time [s] within which the robot makes as much room as it can."""
SLOW = Evasion(Action.SLOW, 0.0)
CARE = {Action.SLOW: 0, Action.WAIT: 1}
"""How much more an action does than to slow down; the others do most."""
MOST_CARE = 2


Mates = Callable[[Pose2D, float, float], Sequence[Feature]]
"""Function that returns the team-mates within a distance [m] of a pose, at a time [s], with their radius as 0."""


class Crossing:
    """Give-way behaviour of one robot towards moving obstacles, for a bounded time."""

    def __init__(self, radius_m: float = 0.15, cruise_mps: float = CRUISE_MPS) -> None:
        self._radius_m = radius_m
        self._slow_mps = SLOW_SHARE * cruise_mps
        self._evasion, self._heading = SLOW, 0.0
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

    def give_way(
        self,
        moving: Sequence[Feature],
        pose: Pose2D,
        wanted: Twist,
        now: float,
        points: Sequence[Point] = (),
        mates: Mates = lambda _pose, _within_m, _now: (),
    ) -> Twist:
        """Return `wanted`, or a slower or evading twist. `moving` holds as of now, in `map` like `pose`; `points` are
        what stands, in `base_link`; `mates` is asked where room is made.
        """
        near = _closest(moving, pose, wanted)
        if near >= CLEARANCE_M and now >= self._held_until:
            self.decision, self._waiting_since, self._impatient = None, None, False
            self._evasion = SLOW
            return wanted
        self._near = near if near < CLEARANCE_M else self._near
        if self._waiting_since is None:
            self._waiting_since = now
        self._impatient = now - self._waiting_since > WAIT_S_MAX
        if self._impatient and _closest(moving, pose, wanted, SOON_S) < self._radius_m + AWAY_M:
            self._impatient, self._waiting_since = False, now  # what was waited for comes on
        if self._impatient:
            self.decision = None
            return wanted
        evasion = (
            SLOW if near >= CLEARANCE_M else self._less(moving, pose, wanted, points, mates(pose, MATES_WITHIN_M, now))
        )
        if self.decision is None or _care(evasion.action) >= _care(self.decision.action) or now >= self._held_until:
            row = decide(Situation("moving", near, closest_m=min(near, self._near)))
            named = ("", "") if row is None else (row.name, row.updates)
            self.decision = Decision(evasion.action, near, 0.0, "moving", *named)
            self._held_until = now + HOLD_S if near < CLEARANCE_M else self._held_until
            if evasion != self._evasion:
                self._evasion, self._heading = evasion, wrap(pose.theta + evasion.turn_rad * _side(evasion))
        if self._evasion.action not in (Action.WAIT, Action.BACK):
            self._waiting_since = now  # a robot that drives on or makes room does not wait
        return self._done(self._present(pose), wanted)

    def _present(self, pose: Pose2D) -> Evasion:
        """Return what is left of the present evasion: its bend ends at the heading that it was chosen for."""
        evasion = self._evasion
        if not evasion.turn_rad:
            return evasion
        left_rad = max(0.0, _side(evasion) * wrap(self._heading - pose.theta))
        return Evasion(evasion.action, evasion.v_mps, evasion.omega_radps if left_rad > 0.0 else 0.0, left_rad)

    def _comes_close(self, feature: Feature, pose: Pose2D) -> bool:
        """Return whether an obstacle is so near that it reaches the robot if it turns towards it, and comes nearer."""
        x, y = feature.x - pose.x, feature.y - pose.y
        return hypot(x, y) < feature.radius_m + self._radius_m + CLOSE_M and x * feature.vx + y * feature.vy < 0.0

    def _less(
        self,
        moving: Sequence[Feature],
        pose: Pose2D,
        wanted: Twist,
        points: Sequence[Point],
        mates: Sequence[Feature],
    ) -> Evasion:
        """Return the least action that keeps the distance; if none does, the one that keeps most of it."""
        if _closest(moving, pose, self._done(SLOW, wanted)) >= CLEARANCE_M:
            return SLOW
        if _closest(moving, pose, STILL) >= CLEARANCE_M:
            return EVASIONS[0]
        best, most = EVASIONS[0], -inf
        close = [feature for feature in moving if self._comes_close(feature, pose)]
        under_way = self.decision is not None and self._evasion is not SLOW
        candidates = (self._present(pose), *EVASIONS) if under_way else EVASIONS
        for evasion in candidates:
            twist = self._done(evasion, wanted)
            if twist.linear_x and free_along(points, twist, self._radius_m + BODY_M) < abs(twist.linear_x) * ROOM_S:
                continue
            if twist.linear_x and _closest(mates, pose, twist, MATE_S) < 2.0 * self._radius_m + MATE_M:
                continue
            if close:
                kept = _apart(close, along_arc(pose, twist, CLOSE_S), 0.5 * CLOSE_S)
            else:
                kept = _kept(moving, pose, evasion, twist)
                kept -= DRIVEN_M if evasion.v_mps < 0.0 else 0.0
            kept += WORTH_M if evasion is candidates[0] else 0.0  # the present one, or waiting
            if kept > most:
                best, most = evasion, kept
        return self._evasion if under_way and best is candidates[0] else best

    def _done(self, evasion: Evasion, wanted: Twist) -> Twist:
        """Return the twist of an evasion where `wanted` is the motion without it."""
        if evasion is SLOW:
            return slowed(wanted, self._slow_mps)
        v = max(wanted.linear_x, evasion.v_mps) if evasion.action is Action.AHEAD else evasion.v_mps
        return Twist(v, evasion.omega_radps)


def _apart(moving: Sequence[Feature], place: Pose2D, later_s: float) -> float:
    """Return the least distance [m] from `place` to the surface of what moves, `later_s` [s] from now."""
    return min(hypot(x - place.x, y - place.y) - f.radius_m for f in moving for x, y in [f.at(later_s)])


def _care(action: Action) -> int:
    return CARE.get(action, MOST_CARE)


def _side(evasion: Evasion) -> float:
    return 1.0 if evasion.omega_radps > 0.0 else -1.0


def _kept(moving: Sequence[Feature], pose: Pose2D, evasion: Evasion, twist: Twist) -> float:
    """Return the least distance [m] to what moves within `LOOK_S` of an evasion: its bend, then straight on."""
    if not evasion.turn_rad:
        return min(_closest(moving, pose, twist, LOOK_S), CLEARANCE_M)
    bend_s = evasion.turn_rad / abs(evasion.omega_radps)
    least = _closest(moving, pose, twist, bend_s)
    later = [Feature(f.kind, *f.at(bend_s), f.radius_m, f.vx, f.vy) for f in moving]
    straight = Twist(twist.linear_x, 0.0)
    return min(least, _closest(later, along_arc(pose, twist, bend_s), straight, LOOK_S - bend_s), CLEARANCE_M)


def _closest(moving: Sequence[Feature], pose: Pose2D, twist: Twist, within_s: float = HORIZON_S) -> float:
    """Return the least distance [m] between the robot's centre and an obstacle's surface within `within_s` [s] from
    now.

    Only approaches count: an obstacle that is already near and moves away is no conflict.
    """
    least = inf
    if not moving:
        return least
    times = [n * STEP_S for n in range(1, round(within_s / STEP_S) + 1)]
    way = [(later, along_arc(pose, twist, later)) for later in times]
    for feature in moving:
        x, y, vx, vy, radius_m = feature.x, feature.y, feature.vx, feature.vy, feature.radius_m
        first = hypot(x - pose.x, y - pose.y)
        for later, there in way:
            apart = hypot(x + vx * later - there.x, y + vy * later - there.y)
            if apart < first and apart - radius_m < least:
                least = apart - radius_m
    return least
