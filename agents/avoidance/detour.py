"""Round what the scan shows: when the wanted motion is not free, the nearest direction that is (control.md section 7).

A detour is a local override: the follower law or the leader's route is asked again each step, and takes over as soon as
the way to its target has been free for a while.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import atan2, cos, hypot, inf, pi, sqrt

from msgspec.structs import replace

from lfa.agents.avoidance import safety
from lfa.agents.avoidance.decision import Decision, DecisionRow, Situation, decide
from lfa.agents.avoidance.openings import (
    ALL_STEPS,
    ASIDE_STEPS,
    BESIDE,
    NARROW_M,
    WIDE_M,
    barring_point,
    first_open,
    Openings,
)
from lfa.agents.config import CONTROL_PERIOD_S
from lfa.agents.perception.obstacle import BlockingObstacle
from lfa.agents.perception.scan import Point, free_along
from lfa.protocol.geometry import STILL, Twist, wrap
from lfa.protocol.mission import Limits

NEARER_M, LEAST_M = 0.005, safety.SKIN_M
"""Who is nearer to a thing than `NARROW_M` already may go where it comes no nearer than it is but for so much, and not
nearer than it would brake for anyway (safety.py)."""
NOISE_M = 0.02
"""A reading of the scan may be so much too short: four standard deviations of the scanner in the paper's worlds."""
REACH_M = 1.6
HEADWAY_S = 0.8
KEEP_SIDE_RAD = 0.6
"""How much nearer a direction on the other side must be before the detour changes sides."""
CLEAR_S = 0.4
HOLD_S = 1.0
"""A decision is held at least this long."""
TURN_GAIN = 2.5
BACK, AHEAD = Twist(-0.15, 0.0), Twist(1.0, 0.0)
SKIN_M = 0.03
SWING_M = 0.05
"""Beside the radius: what the robot needs to turn on the spot."""
CREEP_MPS, CREEP_S, CREEP_FREE_M = 0.1, 2.0, 0.25
"""Towards what has no visible end, to see it, for a bounded time."""
IN_PLACE_RAD = 0.9


class Detour:
    """Whether a robot goes its wanted way or round something, by the decision table, with hysteresis."""

    def __init__(self, radius_m: float, limits: Limits) -> None:
        self._radius_m = radius_m
        self._limits = limits
        self.omega_max_radps = limits.omega_max_radps
        """A leader turns more slowly than its drive could: its followers' slots swing with it."""
        self.decision: Decision | None = None
        """None while the wanted way is taken."""
        self._kept_m = NARROW_M
        """`NARROW_M`, less where the robot is nearer to something already."""
        self._thing = BlockingObstacle()
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
        thing: Callable[[float], BlockingObstacle] = lambda free_m: BlockingObstacle(),
    ) -> Twist | None:
        """The twist of a detour towards `target` (both in `base_link`), or None: the wanted twist may go on.

        `thing` tells what bars the way so far ahead [m]; it is asked when the detour begins, and while it creeps.
        """
        blocked_m = self._blocked(points, wanted)
        if self.decision is None:
            if blocked_m is None or self._blocked(self._not_passed(points, wanted), wanted) is None:
                return None
            self._since, self._clear_since = now, None
            self._side, self._crept_s = 0.0, 0.0
            self._thing = thing(inf if blocked_m is None else blocked_m)
        elif self.decision.action == "creep" and blocked_m is not None:
            self._thing = thing(blocked_m)  # what it creeps for is to see more of it
        elif blocked_m is None and self._clear(points, target, now) and now - self._since >= HOLD_S:
            self.decision = None
            return None
        return self._round(points, target, speed_mps, inf if blocked_m is None else blocked_m, now)

    def _blocked(self, points: Sequence[Point], wanted: Twist) -> float | None:
        """The free way along `wanted` when it is too short, None when it is long enough."""
        v = abs(wanted.linear_x)
        if v <= 0.01:
            return None
        free_m = free_along(points, wanted, self._radius_m + NARROW_M)
        needed_m = v * v / (2.0 * self._limits.a_max_mps2) + HEADWAY_S * v + 0.15
        return free_m if free_m < needed_m else None

    def _not_passed(self, points: Sequence[Point], wanted: Twist) -> list[Point]:
        """`points` less those that the robot has beside it, nearer than it keeps by no more than a scan's noise: it
        is about to have passed them."""
        sign = 1.0 if wanted.linear_x > 0.0 else -1.0
        kept_m = self._radius_m + NARROW_M - NOISE_M
        return [(x, y) for x, y in points if sign * x > BESIDE * abs(y) or hypot(x, y) < kept_m]

    def _clear(self, points: Sequence[Point], target: Point, now: float) -> bool:
        """The straight way to the target has been free for `CLEAR_S`."""
        reach = min(hypot(*target), REACH_M)
        if barring_point(points, atan2(target[1], target[0]), reach, self._radius_m + NARROW_M) is not None:
            self._clear_since = None
            return False
        if self._clear_since is None:
            self._clear_since = now
        return now - self._clear_since >= CLEAR_S

    def _round(self, points: Sequence[Point], target: Point, speed_mps: float, free_m: float, now: float) -> Twist:
        """The row of the table that holds, and the twist of its action."""
        near_m = min((hypot(x, y) for x, y in points), default=inf) - self._radius_m
        self._kept_m = max(LEAST_M, min(NARROW_M, near_m - NEARER_M))
        towards = atan2(target[1], target[0])
        reach = min(max(hypot(*target), 0.3), REACH_M)
        openings = self._openings(points, towards, reach)
        row = self._row(points, openings, free_m)
        side = self._chosen_side(openings, towards, now)
        twist = STILL
        action, bearing = "blocked" if row is None else row.action, towards
        match action:
            case "aside":
                bearing = (openings.left if side > 0.0 else openings.right) or 0.0
                action = "left" if side > 0.0 else "right"
                twist = self._towards(points, bearing, speed_mps)
            case "u_turn" if openings.rear is not None:
                bearing = openings.rear
                twist = self._towards(points, bearing, speed_mps)
            case "back":
                bearing, twist = pi, BACK
            case "creep":
                bearing = 0.0
                twist = Twist(CREEP_MPS, 0.0) if free_m > CREEP_FREE_M else STILL
                self._crept_s += CONTROL_PERIOD_S
            case _:
                action = "blocked"
        if action == "blocked":
            self._open_since = None
        elif self._barred_lately(now):
            action, twist = "blocked", STILL
        self._say(action, free_m, bearing, row if action != "blocked" else None, now)
        return twist

    def _row(self, points: Sequence[Point], openings: Openings, free_m: float) -> DecisionRow | None:
        """The table's row for what was met: an opening is as wide as the robot needs, whatever lies beside it."""
        nose_m = free_along(points, AHEAD, self._radius_m)
        # A bend that would lead nearer to what the robot has beside it says nothing of what is before its nose.
        ahead_m = self._radius_m + (nose_m if self._kept_m < NARROW_M else min(free_m, nose_m))
        kind = "stationary" if self._thing.kind == "moving" else self._thing.kind
        return decide(
            Situation(
                kind,
                ahead_m,
                self._thing.width_m,
                left_m=inf if openings.left is not None else 0.0,
                right_m=inf if openings.right is not None else 0.0,
                rear_m=inf if openings.rear is not None else 0.0,
                back_m=free_along(points, BACK, self._radius_m + SKIN_M),
                crept=self._crept_s >= CREEP_S,
                swing_m=self._radius_m + SWING_M,
            )
        )

    def _openings(self, points: Sequence[Point], towards: float, reach_m: float) -> Openings:
        """With room to spare where there is, else just not touching."""
        for margin_m in dict.fromkeys((WIDE_M, NARROW_M, self._kept_m)):
            half_width_m = self._radius_m + margin_m
            left = first_open(points, towards, 1.0, 0, ASIDE_STEPS, reach_m, half_width_m)
            right = first_open(points, towards, -1.0, 0, ASIDE_STEPS, reach_m, half_width_m)
            if left is not None or right is not None:
                unknown = self._thing.width_m == inf  # the table asks for the way back as well
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
        """The side that needs less turning; the one taken before counts as nearer, and is kept for a while."""
        left = inf if openings.left is None else abs(wrap(openings.left - towards))
        right = inf if openings.right is None else abs(wrap(openings.right - towards))
        if left == right == inf:
            return self._side
        side = 1.0 if left + KEEP_SIDE_RAD * (self._side < 0.0) <= right + KEEP_SIDE_RAD * (self._side > 0.0) else -1.0
        held = now - self._side_at < HOLD_S and (left if self._side > 0.0 else right) < inf
        if side != self._side and not (held and self._side != 0.0):
            self._side, self._side_at = side, now
        return self._side

    def _barred_lately(self, now: float) -> bool:
        """It was blocked, and a way out has not been open for long enough to be more than noise."""
        if self.decision is None or self.decision.action != "blocked":
            self._open_since = None
            return False
        if self._open_since is None:
            self._open_since = now
        return now - self._open_since < CLEAR_S

    def _say(self, action: str, free_m: float, bearing: float, row: DecisionRow | None, now: float) -> None:
        """What is logged keeps its name for a while, unless there is no way at all."""
        before = self.decision
        held = before is not None and now - self._acted_at < HOLD_S and "blocked" not in (action, before.action)
        if before is not None and (held or action == before.action):
            self.decision = replace(before, free_m=free_m, bearing=bearing)
            return
        self._acted_at = now
        condition, updates = ("", "") if row is None else (row.name, row.updates)
        self.decision = Decision(action, free_m, bearing, self._thing.kind, condition, updates)

    def _towards(self, points: Sequence[Point], bearing: float, speed_mps: float) -> Twist:
        omega_max = self.omega_max_radps
        omega = max(-omega_max, min(omega_max, TURN_GAIN * bearing))
        if abs(bearing) > IN_PLACE_RAD:
            return Twist(0.0, omega)
        braking = self._braking(points, NARROW_M)
        if self._kept_m < NARROW_M:  # slowly past what it is too near to
            braking = max(braking, min(CREEP_MPS, self._braking(points, self._kept_m)))
        return Twist(min(speed_mps, braking) * cos(bearing), omega)

    def _braking(self, points: Sequence[Point], margin_m: float) -> float:
        """Speed from which the robot stops before what is ahead of it, `margin_m` wider than it is."""
        free_m = free_along(points, AHEAD, self._radius_m + margin_m)
        return sqrt(self._limits.a_max_mps2 * max(0.0, free_m - 0.1))
