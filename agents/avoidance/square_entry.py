"""Square entry of a polygon into a passage narrower than its circle: along the middle line from before it.

It drives to a gate, a place on the middle line before the passage where it can turn, turns there until it faces along
the line, and follows the line through. Where something stands at the gate, the way into the passage is the route's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import atan2, cos, dist, hypot, inf, sin, sqrt
from typing import NamedTuple

from lfa.agents.avoidance.passage import passage
from lfa.agents.avoidance.safety import turn_on_spot
from lfa.agents.perception.scan import Point
from lfa.protocol.geometry import STILL, Pose2D, Twist, between, compose, wrap
from lfa.protocol.mission import Limits

ROOM_M = 0.05
"""Room [m] beside the body's circle in a passage, below which it counts as narrow, and at a gate."""
GATE_M = 0.35
"""Distance [m] of the gate before the passage, from the farthest corner of the body."""
LOOK_S, KEPT_S = 0.2, 1.0
"""Time [s] between two looks at the passage, and for which one is kept that is no longer seen."""
NEW_SHARE, SAME_M, SAME_RAD = 0.4, 0.3, 0.35
"""Share of the newest look in the middle line, and its distance [m] and angle [rad] from one that is of another
passage."""
AT_M, SQUARE_RAD, ASLANT_RAD = 0.05, 0.04, 0.12
"""Distance [m] from the middle line and before the gate up to which the robot is there; angles [rad] off the line up to
which it is square to the passage at the gate, and keeps to the line before it."""
FACING_RAD = 0.5
"""Angle [rad] off the gate above which the robot turns towards it on the spot."""
PURSUED_M, BEHIND_M = 0.35, 0.4
"""Distance [m] over which the robot comes to the line, and behind the passage at which the route goes on."""
ENDS_M = 1e-3
PATIENCE_S, CALM_S = 12.0, 20.0
"""Time [s] on the way to a gate after which the robot goes on without, and for which it looks for no passage then."""
BRAKING_MPS2, SLOWEST_MPS = 0.3, 0.1
"""Deceleration [m/s^2] towards the gate, and the speed [m/s] there."""

Route = Callable[[float], Point]


class _Seen(NamedTuple):
    """Middle line of a passage as seen from the robot."""

    middle: Pose2D
    """Middle of the passage and its direction in `base_link`."""
    along_m: float
    """Distance [m] of the robot before the middle, along the line."""
    aside_m: float
    """Distance [m] of the robot to the left of the line."""


class SquareEntry:
    """Entry of one robot into the passage that it comes to next."""

    def __init__(self, radius_m: float, half_width_m: float, limits: Limits) -> None:
        self._radius_m = radius_m
        self._widths_m = 2.0 * half_width_m, 2.0 * (radius_m + ROOM_M)
        self._limits = limits
        self._gate_m = radius_m + GATE_M
        """Distance [m] of the gate before the middle of the passage."""
        self._middle: Pose2D | None = None
        """Middle of the passage and its direction in `map`; None while there is none."""
        self._look_at, self._seen_at, self._since = -inf, -inf, -inf
        """Times [s] of the next look, at which the passage was seen last, and since which its gate is driven to."""
        self._square = False
        """True once the robot faces along the middle line, until it is before the gate again."""

    def lead(
        self,
        points: Sequence[Point],
        pose: Pose2D,
        route: Route,
        wanted: Twist,
        speed_mps: float,
        turn_radps: float,
        now: float,
    ) -> tuple[Route, Twist]:
        """Return `route` and `wanted` in `base_link`, or those of the entry while there is a passage.

        `speed_mps` and `turn_radps` are the largest ones straight ahead and on the spot.
        """
        if wanted.linear_x < 0.0 or wanted == STILL or speed_mps <= 0.0:
            return route, wanted
        if now >= self._look_at:
            self._look_at = now + LOOK_S
            self._look(points, pose, route, now)
        if self._middle is None:
            return route, wanted
        seen = _seen(self._middle, pose)
        late = now - self._since > PATIENCE_S and not self._square
        if seen.along_m < -self._gate_m or now - self._seen_at > KEPT_S or late:
            self._middle = None
            if late:
                self._look_at = now + CALM_S
            return route, wanted
        if dist(route(seen.along_m + BEHIND_M), route(seen.along_m + 2.0 * BEHIND_M)) < ENDS_M:
            return route, wanted  # to its end, which lies in the passage
        if self._square and seen.along_m > self._gate_m + 2.0 * AT_M:  # it has backed off
            self._square, self._since = False, now
        if self._square:
            return _through(seen, route, speed_mps)
        return self._to_gate(points, seen, route, wanted, speed_mps, turn_radps)

    def _look(self, points: Sequence[Point], pose: Pose2D, route: Route, now: float) -> None:
        """Update the passage by what is seen from `pose`."""
        found = passage(points, route, *self._widths_m)
        if found is None:
            return
        middle, known = compose(pose, found), self._middle
        held = any(x * x + y * y < self._radius_m * self._radius_m for x, y in points)
        """True in a passage: it is too late for a gate."""
        if known is None or now - self._seen_at > KEPT_S:
            self._middle, self._square = middle, held
            self._since = self._seen_at = now
            return
        off_rad = wrap(middle.theta - known.theta)
        if abs(off_rad) < SAME_RAD and hypot(middle.x - known.x, middle.y - known.y) < SAME_M:
            aside_m = NEW_SHARE * _seen(known, middle).aside_m
            x, y = known.x - aside_m * sin(known.theta), known.y + aside_m * cos(known.theta)
            self._middle, self._seen_at = Pose2D(x, y, known.theta + NEW_SHARE * off_rad), now
        elif not held or _seen(known, pose).along_m < 0.0:
            self._middle, self._seen_at, self._square = middle, now, held

    def _to_gate(
        self,
        points: Sequence[Point],
        seen: _Seen,
        route: Route,
        wanted: Twist,
        speed_mps: float,
        turn_radps: float,
    ) -> tuple[Route, Twist]:
        """Return the way to the gate and along the line, and the twist there; on the line, the turn along it."""
        line, off_rad = seen.middle, wrap(seen.middle.theta)
        c, s = cos(line.theta), sin(line.theta)
        on_line, there = abs(seen.aside_m) < AT_M, seen.along_m < self._gate_m + AT_M
        if on_line and abs(off_rad) < (SQUARE_RAD if there else ASLANT_RAD):
            self._square = there
            return _through(seen, route, speed_mps)
        x, y = line.x - self._gate_m * c, line.y - self._gate_m * s
        room_m = self._radius_m + ROOM_M
        if any((px - x) ** 2 + (py - y) ** 2 < room_m * room_m for px, py in points):
            return route, wanted
        if on_line and there:
            return route, turn_on_spot(off_rad, turn_radps, self._limits)
        left_m, bearing = hypot(x, y), atan2(y, x)
        if abs(bearing) > FACING_RAD:
            return route, turn_on_spot(bearing, turn_radps, self._limits)

        def way(by_m: float) -> Point:
            beyond_m = max(0.0, by_m - left_m)
            share = min(1.0, by_m / left_m)
            return share * x + beyond_m * c, share * y + beyond_m * s

        v = min(speed_mps, max(SLOWEST_MPS, sqrt(2.0 * BRAKING_MPS2 * left_m)))
        return way, Twist(v, v * 2.0 * y / max(left_m, PURSUED_M) ** 2)


def _seen(middle: Pose2D, pose: Pose2D) -> _Seen:
    """Return the line through `middle` in `map` as seen from `pose`."""
    line = between(pose, middle)
    c, s = cos(line.theta), sin(line.theta)
    return _Seen(line, c * line.x + s * line.y, s * line.x - c * line.y)


def _through(seen: _Seen, route: Route, speed_mps: float) -> tuple[Route, Twist]:
    """Return the way along the middle line, and to `route` behind the passage, and the twist on it."""
    c, s = cos(seen.middle.theta), sin(seen.middle.theta)

    def way(by_m: float) -> Point:
        if by_m > seen.along_m + BEHIND_M:
            return route(by_m)
        left_m = -seen.aside_m * min(1.0, by_m / PURSUED_M)
        return c * by_m - s * left_m, s * by_m + c * left_m

    x, y = way(PURSUED_M)
    return way, Twist(speed_mps, speed_mps * 2.0 * y / (x * x + y * y))
