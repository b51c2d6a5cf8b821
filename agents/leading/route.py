"""Route: a polyline in `map` through way-points, with rounded corners, its arc length and curvature.

A corner is rounded so far as the way-point allows: by the largest radius whose arc passes it within a given distance.
A corner that cannot be rounded gently is sharp: the leader drives up to it and turns there.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from itertools import pairwise
from math import atan2, ceil, cos, hypot, inf, pi, sin, tan

from lfa.protocol.geometry import Point, wrap

CORNER_RADIUS_M = 2.5
"""Corner radius [m] of a route, at most."""
SHARP_RADIUS_M = 0.6
"""Corner radius [m] below which a corner is sharp: a look-ahead of the same length would cut it."""
SHARP_RAD = 2.4
"""Turn [rad] beyond which a corner is sharp whatever its radius: its arc would begin far before the way-point."""
SPACING_M = 0.1
LONG_M, COARSE_M = 50.0, 1.0
"""Length [m] of a straight above which it has coarser points except at its ends: a step lays a route of kilometres."""
PASS_SHARE = 1.2
"""Length of a leg of the route, at most, as a multiple of its straight length."""
BEND_SPAN_M = 0.3
"""Distance [m] before and after a point over which its curvature is taken."""


class Route:
    """Polyline in `map` with rounded corners, its arc length and curvature."""

    def __init__(self, points: Sequence[Point], corner_radius_m: float = CORNER_RADIUS_M, miss_m: float = inf) -> None:
        """Create a route through `points`; its arcs have a radius of at most `corner_radius_m`, and pass their corners
        within `miss_m`.
        """
        self.points = _resampled(_rounded(points, corner_radius_m, miss_m), SPACING_M)
        self.at_m = [0.0]
        for a, b in pairwise(self.points):
            self.at_m.append(self.at_m[-1] + hypot(b[0] - a[0], b[1] - a[1]))
        self.length_m = self.at_m[-1]
        self._legs = [_leg(a, b) for a, b in pairwise(self.points)]
        self.curvature = _curvatures(self.points)
        self.sharp_m = self._sharp(points, corner_radius_m, miss_m)
        """Arc length [m] of each sharp corner."""
        for at_m in self.sharp_m:
            for i in range(self.segment(at_m - BEND_SPAN_M), self.segment(at_m + BEND_SPAN_M) + 2):
                self.curvature[i] = 0.0  # the robot turns there, and does not drive a bend

    def point(self, s: float) -> Point:
        """Return the point at arc length `s` [m], clamped to the ends."""
        i = self.segment(s)
        (ax, ay), (bx, by) = self.points[i], self.points[i + 1]
        share = (min(max(s, 0.0), self.length_m) - self.at_m[i]) / max(self.at_m[i + 1] - self.at_m[i], 1e-9)
        return ax + share * (bx - ax), ay + share * (by - ay)

    def heading(self, s: float) -> float:
        """Return the direction [rad] of the route at arc length `s` [m]."""
        i = self.segment(s)
        (ax, ay), (bx, by) = self.points[i], self.points[i + 1]
        return atan2(by - ay, bx - ax)

    def nearest(self, x: float, y: float, low_m: float = 0.0, high_m: float = inf) -> float:
        """Return the arc length of the point nearest to (x, y) between `low_m` and `high_m`."""
        first, last = self.segment(low_m), self.segment(min(high_m, self.length_m))
        best, nearest, share_of_it = inf, -1, 0.0
        for i, (ax, ay, dx, dy, square) in enumerate(self._legs[first : last + 1], first):
            px, py = x - ax, y - ay
            share = (px * dx + py * dy) / square
            share = 0.0 if share < 0.0 else 1.0 if share > 1.0 else share
            apart = hypot(px - share * dx, py - share * dy)
            if apart < best:
                best, nearest, share_of_it = apart, i, share
        if nearest < 0:
            return low_m
        at_m = self.at_m[nearest] + share_of_it * (self.at_m[nearest + 1] - self.at_m[nearest])
        return min(max(at_m, low_m), high_m)

    def segment(self, s: float) -> int:
        """Return the index of the point at or before arc length `s` [m]."""
        return min(max(bisect_right(self.at_m, s) - 1, 0), len(self.points) - 2)

    def joined_m(self, x: float, y: float, heading: float, within_m: float, high_m: float) -> float:
        """Return the arc length of the first pass by (x, y) within `within_m` in the direction `heading` [rad], not
        beyond `high_m`; 0 if there is none.
        """
        best, at_m = inf, 0.0
        for s, (px, py) in zip(self.at_m, self.points, strict=True):
            apart = hypot(px - x, py - y)
            if s > high_m or apart > best + within_m:
                break
            if apart < min(best, within_m) and abs(wrap(self.heading(s) - heading)) < pi / 3:
                best, at_m = apart, s
        return at_m

    def passes(self, points: Sequence[Point]) -> list[float]:
        """Return the arc length [m] at which the route passes each of `points`, in their order: it may pass a place
        many times. The route begins at the first of them, and ends at the last.
        """
        found = [0.0]
        for (ax, ay), (bx, by) in pairwise(points):
            leg_m = hypot(bx - ax, by - ay)
            found.append(self.nearest(bx, by, found[-1], found[-1] + PASS_SHARE * leg_m + SPACING_M))
        return [*found[:-1], self.length_m]

    def _sharp(self, points: Sequence[Point], corner_radius_m: float, miss_m: float) -> tuple[float, ...]:
        corners = zip(self.passes(points)[1:], points, points[1:], points[2:], strict=False)
        return tuple(at_m for at_m, a, b, c in corners if _is_sharp(a, b, c, corner_radius_m, miss_m))


def _leg(a: Point, b: Point) -> tuple[float, float, float, float, float]:
    """Return a leg's start, its direction and length as (dx, dy), and its length squared."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    return *a, dx, dy, max(dx * dx + dy * dy, 1e-12)


def _turn(a: Point, corner: Point, b: Point) -> float:
    """Return the change of direction [rad] at `corner`; 0 where a leg has no length."""
    leg_in, leg_out = hypot(corner[0] - a[0], corner[1] - a[1]), hypot(b[0] - corner[0], b[1] - corner[1])
    if min(leg_in, leg_out) < 1e-9:
        return 0.0
    return wrap(atan2(b[1] - corner[1], b[0] - corner[0]) - atan2(corner[1] - a[1], corner[0] - a[0]))


def _radius_of(turn: float, corner_radius_m: float, miss_m: float) -> float:
    """Return the radius [m] of a corner's arc: at most `corner_radius_m`, passing the corner within `miss_m`."""
    half = cos(min(abs(turn), 3.1) / 2.0)
    return min(corner_radius_m, miss_m * half / max(1.0 - half, 1e-9))


def _is_sharp(a: Point, corner: Point, b: Point, corner_radius_m: float, miss_m: float) -> bool:
    turn = _turn(a, corner, b)
    if abs(turn) > SHARP_RAD:
        return True
    return miss_m < inf and abs(turn) > 0.02 and _radius_of(turn, corner_radius_m, miss_m) < SHARP_RADIUS_M


def _rounded(points: Sequence[Point], radius_m: float, miss_m: float) -> list[Point]:
    """Replace corners by arcs, smaller where the legs are short; sharp ones stay corners."""
    rounded = [points[0]]
    for a, corner, b in zip(points, points[1:], points[2:], strict=False):
        turn = _turn(a, corner, b)
        leg_in, leg_out = hypot(corner[0] - a[0], corner[1] - a[1]), hypot(b[0] - corner[0], b[1] - corner[1])
        heading = atan2(corner[1] - a[1], corner[0] - a[0])
        tangent = tan(abs(turn) / 2.0) if abs(turn) < SHARP_RAD else inf
        cut = min(_radius_of(turn, radius_m, miss_m) * tangent, 0.45 * leg_in, 0.45 * leg_out)
        if abs(turn) < 0.02 or cut < 1e-3 or _is_sharp(a, corner, b, radius_m, miss_m):
            rounded.append(corner)
            continue
        r = cut / tangent
        side = 1.0 if turn > 0.0 else -1.0
        start = (corner[0] - cut * cos(heading), corner[1] - cut * sin(heading))
        center = (start[0] - side * r * sin(heading), start[1] + side * r * cos(heading))
        steps = max(2, ceil(abs(turn) * r / SPACING_M))
        for n in range(steps + 1):
            angle = heading - side * pi / 2 + turn * n / steps
            rounded.append((center[0] + r * cos(angle), center[1] + r * sin(angle)))
    rounded.append(points[-1])
    return rounded


def _resampled(points: Sequence[Point], spacing_m: float) -> list[Point]:
    """Return the polyline with segments of at most `spacing_m` and without repeated points.

    A straight longer than `LONG_M` has segments of up to `COARSE_M` farther than that from both of its ends.
    """
    out = [points[0]]
    for a, b in pairwise(points):
        length = hypot(b[0] - a[0], b[1] - a[1])
        if length < 1e-9:
            continue
        near = COARSE_M / length
        ends = (0.0, near, 1.0 - near, 1.0) if length > LONG_M else (0.0, 1.0)
        for (low, high), gap_m in zip(pairwise(ends), (spacing_m, COARSE_M, spacing_m), strict=False):
            steps = ceil((high - low) * length / gap_m)
            shares = [low + (high - low) * n / steps for n in range(1, steps + 1)]
            out += [(a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share) for share in shares]
    return out if len(out) > 1 else [points[0], (points[0][0] + 1e-3, points[0][1])]


def _curvatures(points: Sequence[Point]) -> list[float]:
    """Return the signed curvature [1/m] at each point, from the points `BEND_SPAN_M` before and after it, left > 0."""
    reach = max(1, round(BEND_SPAN_M / SPACING_M))
    out = [0.0] * len(points)
    for i in range(reach, len(points) - reach):
        a, b, c = points[i - reach], points[i], points[i + reach]
        turn = wrap(atan2(c[1] - b[1], c[0] - b[0]) - atan2(b[1] - a[1], b[0] - a[0]))
        length = 0.5 * (hypot(b[0] - a[0], b[1] - a[1]) + hypot(c[0] - b[0], c[1] - b[1]))
        out[i] = turn / max(length, 1e-6)
    return out
