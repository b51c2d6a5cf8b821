"""Detour around obstacles of the scan: if the wanted motion is blocked, the nearest free direction (control.md section
7).

A detour is a local override: the follower law or the leader's route is computed again each step, and takes over as soon
as the way to its target has been free for a while.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import atan2, cos, hypot, inf, pi, sqrt

from msgspec.structs import replace

from lfa.agents.avoidance import safety
from lfa.agents.avoidance.decision import Action, Decision, DecisionRow, Situation, decide
from lfa.agents.avoidance.openings import (
    ALL_STEPS,
    ASIDE_STEPS,
    BESIDE,
    NARROW_M,
    WIDE_M,
    Openings,
    barring_point,
    first_open,
)
from lfa.agents.config import CONTROL_PERIOD_S
from lfa.agents.perception.obstacle import BlockingObstacle
from lfa.agents.perception.scan import Point, free_along
from lfa.protocol.geometry import STILL, Twist, wrap
from lfa.protocol.mission import Limits

NEARER_M, LEAST_M = 0.005, safety.SKIN_M
"""If already inside `NARROW_M`, a motion may reduce the clearance by at most NEARER_M [m], and never below LEAST_M [m],
for which the robot would brake anyway (safety.py)."""
NOISE_M = 0.02
"""Error [m] by which a scan reading may be too short: four standard deviations of the scanner in the paper's worlds."""
REACH_M = 1.6
HEADWAY_S = 0.8
OWN_SHARE = 0.5
"""Weight of the turn off the robot's own direction: half-way round an obstacle, its target lies on the other side."""
SETTLE_S = 0.25
"""Time [s] from the begin of a detour in which its side is open: the first scans may show a part of the obstacle."""
KEEP_SIDE_RAD = 0.6
"""Angle [rad] by which a direction on the other side must be nearer before the detour changes sides."""
CLEAR_S = 0.4
HOLD_S = 1.0
"""Minimum time [s] that a decision is held."""
TURN_GAIN = 2.5
BACK, AHEAD = Twist(-0.15, 0.0), Twist(1.0, 0.0)
SKIN_M = 0.03
SWING_M = 0.05
"""Margin [m] beside the radius that the robot needs to turn on the spot."""
CREEP_MPS, CREEP_S, CREEP_FREE_M = 0.1, 2.0, 0.25
"""Speed [m/s], longest time [s] and least free distance [m] of creeping towards an obstacle without a visible end, to
see more of it."""
IN_PLACE_RAD = 0.9


class Detour:
    """Detour of one robot: its wanted motion or a way around an obstacle, by the decision table, with hysteresis."""

    def __init__(self, radius_m: float, limits: Limits, period_s: float = CONTROL_PERIOD_S) -> None:
        """Create a detour; `steer` is called each `period_s`."""
        self._radius_m = radius_m
        self._limits = limits
        self.period_s = period_s
        self.omega_max_radps = limits.omega_max_radps
        """Maximum turn rate [rad/s]; a leader's is lower than its drive allows, since its followers' slots swing with
        it."""
        self.decision: Decision | None = None
        """Present decision; None while the wanted motion is taken."""
        self._kept_m = NARROW_M
        """Kept clearance [m]: `NARROW_M`, or less where the robot is nearer to an obstacle already."""
        self._obstacle = BlockingObstacle()
        self._side = 0.0
        self._side_at = -inf
        self._acted_at = -inf
        self._clear_since: float | None = None
        self._since = -inf
        self._crept_s = 0.0
        self._open_since: float | None = None

    def steer(
        self,
        points: Sequence[Point],
        target: Point,
        wanted: Twist,
        speed_mps: float,
        now: float,
        obstacle: Callable[[float], BlockingObstacle] = lambda free_m: BlockingObstacle(),
    ) -> Twist | None:
        """Return the twist of a detour towards `target` (both in `base_link`); None if the wanted twist may go on.

        `obstacle(free_m)` returns what blocks the way after that distance [m]. It is called when the detour begins, and
        while the robot creeps.
        """
        blocked_m = self._blocked(points, wanted)
        if self.decision is None:
            if blocked_m is None or self._blocked(self._not_passed(points, wanted), wanted) is None:
                return None
            self._since, self._clear_since = now, None
            self._side, self._crept_s = 0.0, 0.0
            self._obstacle = obstacle(inf if blocked_m is None else blocked_m)
        elif blocked_m is not None:
            self._clear_since = None  # one scan in which the motion is free ends no detour
            if self.decision.action is Action.CREEP:
                self._obstacle = obstacle(blocked_m)  # creeping is meant to show more of it
        elif self._clear(points, target, now) and now - self._since >= HOLD_S:
            self.decision = None
            return None
        return self._round(points, target, speed_mps, inf if blocked_m is None else blocked_m, now)

    def _blocked(self, points: Sequence[Point], wanted: Twist) -> float | None:
        """Return the free distance [m] along `wanted` when it is too short, None when it is long enough."""
        v = abs(wanted.linear_x)
        if v <= 0.01:
            return None
        free_m = free_along(points, wanted, self._radius_m + NARROW_M)
        needed_m = v * v / (2.0 * self._limits.a_max_mps2) + HEADWAY_S * v + 0.15
        return free_m if free_m < needed_m else None

    def _not_passed(self, points: Sequence[Point], wanted: Twist) -> list[Point]:
        """Return `points` without those beside the robot that are inside its clearance by no more than the scan's
        noise: it has nearly passed them.
        """
        sign = 1.0 if wanted.linear_x > 0.0 else -1.0
        kept_m = self._radius_m + NARROW_M - NOISE_M
        return [(x, y) for x, y in points if sign * x > BESIDE * abs(y) or hypot(x, y) < kept_m]

    def _clear(self, points: Sequence[Point], target: Point, now: float) -> bool:
        """Return whether the straight way to the target has been free for `CLEAR_S`."""
        reach = min(hypot(*target), REACH_M)
        if barring_point(points, atan2(target[1], target[0]), reach, self._radius_m + NARROW_M) is not None:
            self._clear_since = None
            return False
        if self._clear_since is None:
            self._clear_since = now
        return now - self._clear_since >= CLEAR_S

    def _round(self, points: Sequence[Point], target: Point, speed_mps: float, free_m: float, now: float) -> Twist:
        """Choose the row of the decision table and return the twist of its action."""
        near_m = min((hypot(x, y) for x, y in points), default=inf) - self._radius_m
        self._kept_m = max(LEAST_M, min(NARROW_M, near_m - NEARER_M))
        towards = atan2(target[1], target[0])
        reach = min(max(hypot(*target), 0.3), REACH_M)
        openings = self._openings(points, towards, reach)
        row = self._row(points, openings, free_m)
        side = self._chosen_side(openings, towards, now)
        twist = STILL
        action, bearing = Action.BLOCKED if row is None else row.action, towards
        match action:
            case Action.ASIDE:
                bearing = (openings.left if side > 0.0 else openings.right) or 0.0
                action = Action.LEFT if side > 0.0 else Action.RIGHT
                twist = self._towards(points, bearing, speed_mps)
            case Action.U_TURN if openings.rear is not None:
                bearing = openings.rear
                twist = self._towards(points, bearing, speed_mps)
            case Action.BACK:
                bearing, twist = pi, BACK
            case Action.CREEP:
                bearing = 0.0
                twist = Twist(CREEP_MPS, 0.0) if free_m > CREEP_FREE_M else STILL
                self._crept_s += self.period_s
            case _:
                action = Action.BLOCKED
        if action is Action.BLOCKED:
            self._open_since = None
        elif self._barred_lately(now):
            action, twist = Action.BLOCKED, STILL
        self._say(action, free_m, bearing, row if action is not Action.BLOCKED else None, now)
        return twist

    def _row(self, points: Sequence[Point], openings: Openings, free_m: float) -> DecisionRow | None:
        """Return the table's row for the obstacle. An opening counts as wide as the robot needs, whatever lies beside
        it.
        """
        nose_m = free_along(points, AHEAD, self._radius_m)
        # A bend towards what is already beside the robot does not tell how far the way straight ahead is free.
        ahead_m = self._radius_m + (nose_m if self._kept_m < NARROW_M else min(free_m, nose_m))
        kind = "stationary" if self._obstacle.kind == "moving" else self._obstacle.kind
        return decide(
            Situation(
                kind,
                ahead_m,
                self._obstacle.width_m,
                left_m=inf if openings.left is not None else 0.0,
                right_m=inf if openings.right is not None else 0.0,
                rear_m=inf if openings.rear is not None else 0.0,
                back_m=free_along(points, BACK, self._radius_m + SKIN_M),
                crept=self._crept_s >= CREEP_S,
                swing_m=self._radius_m + SWING_M,
            )
        )

    def _openings(self, points: Sequence[Point], towards: float, reach_m: float) -> Openings:
        """Return the openings with a wide margin where there is room, else with the kept clearance."""
        for margin_m in dict.fromkeys((WIDE_M, NARROW_M, self._kept_m)):
            half_width_m = self._radius_m + margin_m
            left = first_open(points, towards, 1.0, 0, ASIDE_STEPS, reach_m, half_width_m)
            right = first_open(points, towards, -1.0, 0, ASIDE_STEPS, reach_m, half_width_m)
            if left is not None or right is not None:
                unknown = self._obstacle.width_m == inf  # the table needs the rear opening as well
                return Openings(left, right, self._rear(points, towards, reach_m) if unknown else None)
        return Openings(None, None, self._rear(points, towards, reach_m))

    def _rear(self, points: Sequence[Point], towards: float, reach_m: float) -> float | None:
        side = self._side or 1.0
        for margin_m in dict.fromkeys((WIDE_M, NARROW_M, self._kept_m)):
            half_width_m = self._radius_m + margin_m
            rear = first_open(points, towards, side, ASIDE_STEPS + 1, ALL_STEPS, reach_m, half_width_m)
            if rear is not None:
                return rear
        return None

    def _chosen_side(self, openings: Openings, towards: float, now: float) -> float:
        """Return the side that needs less turning, off the target's direction and off the robot's own. The present side
        gets a bonus and is held for a while, once the first scans have settled which one is nearer.
        """
        left, right = _turning(openings.left, towards), _turning(openings.right, towards)
        if left == right == inf:
            return self._side
        if now - self._since < SETTLE_S:
            self._side = 1.0 if left <= right else -1.0
            return self._side
        side = 1.0 if left + KEEP_SIDE_RAD * (self._side < 0.0) <= right + KEEP_SIDE_RAD * (self._side > 0.0) else -1.0
        held = now - self._side_at < HOLD_S and (left if self._side > 0.0 else right) < inf
        if side != self._side and not (held and self._side != 0.0):
            self._side, self._side_at = side, now
        return self._side

    def _barred_lately(self, now: float) -> bool:
        """Return whether the robot was blocked and no opening has lasted long enough to be more than noise."""
        if self.decision is None or self.decision.action is not Action.BLOCKED:
            self._open_since = None
            return False
        if self._open_since is None:
            self._open_since = now
        return now - self._open_since < CLEAR_S

    def _say(self, action: Action, free_m: float, bearing: float, row: DecisionRow | None, now: float) -> None:
        """Record the decision for the log. Its action keeps its name for a while, unless the robot is or was
        blocked.
        """
        before = self.decision
        held = before is not None and now - self._acted_at < HOLD_S and Action.BLOCKED not in (action, before.action)
        if before is not None and (held or action == before.action):
            self.decision = replace(before, free_m=free_m, bearing=bearing)
            return
        self._acted_at = now
        condition, updates = ("", "") if row is None else (row.name, row.updates)
        self.decision = Decision(action, free_m, bearing, self._obstacle.kind, condition, updates)

    def _towards(self, points: Sequence[Point], bearing: float, speed_mps: float) -> Twist:
        omega_max = self.omega_max_radps
        omega = max(-omega_max, min(omega_max, TURN_GAIN * bearing))
        if abs(bearing) > IN_PLACE_RAD:
            return Twist(0.0, omega)
        braking = self._braking(points, NARROW_M)
        if self._kept_m < NARROW_M:  # drive slowly past what is nearer than the clearance
            braking = max(braking, min(CREEP_MPS, self._braking(points, self._kept_m)))
        return Twist(min(speed_mps, braking) * cos(bearing), omega)

    def _braking(self, points: Sequence[Point], margin_m: float) -> float:
        """Return the speed [m/s] from which the robot can stop before an obstacle ahead, with `margin_m` on either
        side.
        """
        free_m = free_along(points, AHEAD, self._radius_m + margin_m)
        return sqrt(self._limits.a_max_mps2 * max(0.0, free_m - 0.1))


def _turning(opening: float | None, towards: float) -> float:
    """Return what a direction costs in turning [rad], off `towards` and off the robot's own; inf without one."""
    return inf if opening is None else abs(wrap(opening - towards)) + OWN_SHARE * abs(opening)
