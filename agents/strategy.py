"""Round what the scan shows: when the wanted motion is not free, the nearest direction that is (control.md section 7).

A detour is a local override: the follower law or the leader's route is asked again each step, and takes over as soon as
the way to its target has been free for a while.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, hypot, inf, pi, sin

from msgspec import Struct

from agents.perception import Point, free_along
from protocol.geometry import Twist, wrap
from protocol.mission import Limits

STEP_RAD = pi / 24
SIDES_STEPS = 24
WIDE_M = 0.20
"""Kept from the body's surface where there is room."""
NARROW_M = 0.08
"""Never less (control.md section 7)."""
REACH_M = 1.6
HEADWAY_S = 0.8
KEEP_SIDE_RAD = 0.6
"""How much nearer a direction on the other side must be before the detour changes sides."""
CLEAR_S = 0.4
HOLD_S = 1.0
"""A decision is held at least this long."""
TURN_GAIN = 2.5
IN_PLACE_RAD = 0.9


class Decision(Struct, frozen=True):
    """What a detour does now, with the values that it was decided by, for the log."""

    action: str
    """`left`, `right`, `u_turn`, `blocked`; of what moves: `slow`, `wait`, `back`."""
    free_m: float
    """Clear way along the motion that was wanted."""
    bearing: float
    """Chosen direction in `base_link` [rad]."""
    kind: str = "stationary"
    """Class of what is met: `stationary`, `moving`, `wall`, `pothole`, `bump` or `ditch`."""
    condition: str = ""
    """The row of the decision table, by its condition, and what the decision updates (decisions.py)."""
    updates: str = ""


class Detour:
    """Whether a robot goes its wanted way or round something, with hysteresis."""

    def __init__(self, radius_m: float, limits: Limits) -> None:
        self._radius_m = radius_m
        self._limits = limits
        self.omega_max_radps = limits.omega_max_radps
        """A leader turns more slowly than its drive could: its followers' slots swing with it."""
        self.decision: Decision | None = None
        """None while the wanted way is taken."""
        self._side = 0.0
        self._clear_since: float | None = None
        self._since = -inf

    def steer(
        self, points: Sequence[Point], target: Point, wanted: Twist, speed_mps: float, now: float
    ) -> Twist | None:
        """The twist of a detour towards `target` (both in `base_link`), or None: the wanted twist may go on."""
        blocked_m = self._blocked(points, wanted)
        if self.decision is None and blocked_m is None:
            return None
        if self.decision is None:
            self._since, self._clear_since = now, None
        elif blocked_m is None and self._clear(points, target, now) and now - self._since >= HOLD_S:
            self.decision = None
            return None
        return self._round(points, target, speed_mps, inf if blocked_m is None else blocked_m)

    def _blocked(self, points: Sequence[Point], wanted: Twist) -> float | None:
        """The free way along `wanted` when it is too short, None when it is long enough."""
        v = wanted.linear_x
        if v <= 0.01:
            return None
        free_m = free_along(points, wanted, self._radius_m + NARROW_M)
        needed_m = v * v / (2.0 * self._limits.a_max_mps2) + HEADWAY_S * v + 0.15
        return free_m if free_m < needed_m else None

    def _clear(self, points: Sequence[Point], target: Point, now: float) -> bool:
        """The straight way to the target has been free for `CLEAR_S`."""
        reach = min(hypot(*target), REACH_M)
        if not _open(points, atan2(target[1], target[0]), reach, self._radius_m + NARROW_M):
            self._clear_since = None
            return False
        if self._clear_since is None:
            self._clear_since = now
        return now - self._clear_since >= CLEAR_S

    def _round(self, points: Sequence[Point], target: Point, speed_mps: float, free_m: float) -> Twist:
        towards = atan2(target[1], target[0])
        reach = min(max(hypot(*target), 0.3), REACH_M)
        for margin_m in (WIDE_M, NARROW_M):
            bearing = self._direction(points, towards, reach, self._radius_m + margin_m)
            if bearing is not None:
                break
        if bearing is None:
            self.decision = Decision("blocked", free_m, towards)
            return Twist(0.0, 0.0)
        offset = wrap(bearing - towards)
        self._side = self._side if offset == 0.0 else (1.0 if offset > 0.0 else -1.0)
        action = "u_turn" if abs(bearing) > 0.75 * pi else "left" if self._side > 0.0 else "right"
        self.decision = Decision(action, free_m, bearing)
        return self._towards(points, bearing, speed_mps)

    def _direction(self, points: Sequence[Point], towards: float, reach: float, half_width_m: float) -> float | None:
        """The open direction nearest to `towards`; those on the side taken so far count as nearer."""
        best, best_cost = None, inf
        for n in range(SIDES_STEPS + 1):
            offset = n * STEP_RAD
            if offset >= best_cost:
                break
            for side in (1.0, -1.0):
                cost = offset + (KEEP_SIDE_RAD if n > 0 and side * self._side < 0.0 else 0.0)
                bearing = wrap(towards + side * offset)
                if cost < best_cost and _open(points, bearing, reach, half_width_m):
                    best, best_cost = bearing, cost
        return best

    def _towards(self, points: Sequence[Point], bearing: float, speed_mps: float) -> Twist:
        omega_max = self.omega_max_radps
        omega = max(-omega_max, min(omega_max, TURN_GAIN * bearing))
        if abs(bearing) > IN_PLACE_RAD:
            return Twist(0.0, omega)
        free_m = free_along(points, Twist(1.0, 0.0), self._radius_m + NARROW_M)
        braking = (self._limits.a_max_mps2 * max(0.0, free_m - 0.1)) ** 0.5
        return Twist(min(speed_mps, braking) * cos(bearing), omega)


def _open(points: Sequence[Point], bearing: float, reach_m: float, half_width_m: float) -> bool:
    """No point within `half_width_m` of the straight way of `reach_m` in direction `bearing`.

    A point that is already nearer than the half width bars only what goes towards it, not what passes it by.
    """
    c, s = cos(bearing), sin(bearing)
    for x, y in points:
        along = c * x + s * y
        if 0.0 < along < reach_m + half_width_m:
            across = c * y - s * x
            if -half_width_m < across < half_width_m and along > 0.25 * abs(across):
                return False
    return True
