"""Body of a robot that is a convex polygon, and its free way among the points of a scan.

In a passage narrower than its circle the polygon is moved along the arc: what it sweeps decides, its rear corners
included. So it does for a turn on the spot, which a round body can always make.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from math import acos, atan2, floor, hypot, inf, sqrt

from msgspec import Struct

from lfa.agents.perception.scan import ROUNDED, STRAIGHT_RADPS, Point
from lfa.protocol.geometry import TAU, Twist, convex, wrap
from lfa.protocol.mission import Mission

NEARING = 0.02
"""Share of its way by which a point inside the margin may come nearer to the side that it is beside: a wall along which
the robot drives does not stop it."""
NEARER_MM = 2.0
"""Length [mm] by which less is kept than the nearest point inside the margin leaves: other readings err, too."""
ERROR_M = 0.02
"""Depth [m] inside the body up to which a reading errs as those of a wall beside it do. A deeper one is of no wall, and
says nothing of how far the others err: a part of the robot itself, dust before the scanner."""
CORNER = 1.5
"""Length of a right corner of the margin in margins, and more."""
PAST_RAD = 1e-9
"""Angle [rad] by which a turn is led past the end of what a side bars, so that it is not found there again."""

Side = tuple[float, float, float]
"""Outward normal x, y of one side of a polygon, and its distance [m] from `base_link`."""


class _Grown(Struct, frozen=True):
    """Polygon with a margin around it, its corners kept sharp."""

    sides: tuple[Side, ...]
    corners: tuple[Point, ...]


class PolygonBody:
    """Polygon of one robot's body in `base_link`, with corners counter-clockwise around the origin."""

    def __init__(self, corners_m: Sequence[Point]) -> None:
        self._sides = tuple(_side(corners_m[n - 1], corner) for n, corner in enumerate(corners_m))
        self._core_m = -0.5 * min(far_m for _, _, far_m in self._sides)
        """Margin [m], negative, of what is surely body: an error of a reading does not reach it."""
        self.reach_m = max(hypot(x, y) for x, y in corners_m)
        """Radius [m] of the circle that it turns in."""
        self._grown = cache(self._grow)  # bounded by the number of margins in the program

    @classmethod
    def of(cls, mission: Mission) -> PolygonBody | None:
        """Return the polygon of the mission's robots; None for round ones, and for what is no polygon of a body."""
        corners = mission.footprint_m or ()
        if not convex(corners) or any(_side(corners[n - 1], corner)[2] <= 0.0 for n, corner in enumerate(corners)):
            return None
        return cls(corners)

    def free_along(self, points: Sequence[Point], twist: Twist, margin_m: float, within_m: float = inf) -> float:
        """Return the distance [m] that the body can drive along the arc of `twist` before it comes within `margin_m` of
        a point; `within_m` if it meets none before.

        What is inside the margin already ends the way only if it comes nearer; else less than the margin is kept.
        """
        v, omega = twist.linear_x, twist.angular_z
        if v == 0.0:
            return within_m
        if abs(omega) > STRAIGHT_RADPS * abs(v):
            radius_m = abs(v / omega)
            free_rad = self._free_rad(points, twist, v / omega, margin_m, within_m / radius_m)
            return within_m if free_rad == within_m / radius_m else radius_m * free_rad
        met = self._met(points, twist, margin_m)
        if met is None:
            return 0.0
        sign, free_m = (1.0 if v > 0.0 else -1.0), within_m
        for grown, those in met:
            free_m = min([free_m, *(_straight(grown.sides, x, y, sign) for x, y in those)])
        return max(0.0, free_m)

    def free_turn(self, points: Sequence[Point], radps: float, margin_m: float, within_rad: float = inf) -> float:
        """Return the angle [rad] of a turn on the spot towards the sign of `radps`, until a point is met as there."""
        return self._free_rad(points, Twist(0.0, radps), 0.0, margin_m, within_rad)

    def _free_rad(
        self, points: Sequence[Point], twist: Twist, center_y: float, margin_m: float, within_rad: float
    ) -> float:
        """Return the angle [rad] of a turn about (0, `center_y`) until a point is met."""
        met = self._met(points, twist, margin_m)
        if met is None:
            return 0.0
        free_rad = within_rad
        for grown, those in met:
            free_rad = _turn(grown, those, center_y, twist.angular_z, free_rad)
        return free_rad

    def _met(
        self, points: Sequence[Point], twist: Twist, margin_m: float
    ) -> list[tuple[_Grown, Sequence[Point]]] | None:
        """Return the body with the margin that a motion can keep, and the points that it must not meet: `margin_m`, or
        a little less than the nearest point leaves; None where `twist` brings a point inside the margin nearer to the
        side that it is beside. Points deeper in the body than `ERROR_M` must only not come into its core.
        """
        reach_m, v, omega = self.reach_m + CORNER * margin_m, twist.linear_x, twist.angular_z
        square, nearest_m, deep = reach_m * reach_m, margin_m, list[Point]()
        for x, y in points:
            if x * x + y * y >= square:
                continue
            apart_m, nx, ny = max([(nx * x + ny * y - far_m, nx, ny) for nx, ny, far_m in self._sides])
            if apart_m < margin_m:
                moves_x, moves_y = omega * y - v, -omega * x
                if nx * moves_x + ny * moves_y < -NEARING * hypot(moves_x, moves_y):
                    return None
                if apart_m < -ERROR_M:
                    deep.append((x, y))
                else:
                    nearest_m = min(nearest_m, apart_m)
        kept_m = margin_m
        if nearest_m < margin_m:  # in whole millimetres, so that few polygons are kept
            kept_m = max(floor(1000.0 * nearest_m - NEARER_MM) / 1000.0, self._core_m)
        if not deep:
            return [(self._grown(kept_m), points)]
        others = [point for point in points if point not in deep]
        return [(self._grown(kept_m), others), (self._grown(self._core_m), deep)]

    def _grow(self, margin_m: float) -> _Grown:
        sides = tuple((nx, ny, far_m + margin_m) for nx, ny, far_m in self._sides)
        return _Grown(sides, tuple(_corner(sides[n - 1], side) for n, side in enumerate(sides)))


def _turn(grown: _Grown, points: Sequence[Point], center_y: float, omega: float, within_rad: float) -> float:
    """Return the angle [rad] of a turn about (0, `center_y`), towards the sign of `omega`, until `grown` meets a point;
    `within_rad` if it meets none before.
    """
    outer_m = max(hypot(x, y - center_y) for x, y in grown.corners)
    inner_m = max(0.0, *(ny * center_y - far_m for _, ny, far_m in grown.sides))
    # The largest distance beyond a side is a lower bound of that to the polygon: no point that is met is left out.
    near, far = inner_m * inner_m / ROUNDED, outer_m * outer_m * ROUNDED
    direction = -1.0 if omega > 0.0 else 1.0  # seen from the body the points turn the other way
    free_rad = within_rad
    for x, y in points:
        beside = y - center_y
        square = x * x + beside * beside
        if near < square < far:
            met_rad = _turned(grown.sides, center_y, atan2(beside, x), sqrt(square), direction, free_rad)
            free_rad = min(free_rad, met_rad)
    return free_rad


def _side(a: Point, b: Point) -> Side:
    length_m = hypot(b[0] - a[0], b[1] - a[1])
    nx, ny = (b[1] - a[1]) / length_m, (a[0] - b[0]) / length_m
    return nx, ny, nx * a[0] + ny * a[1]


def _corner(first: Side, second: Side) -> Point:
    (ax, ay, a_m), (bx, by, b_m) = first, second
    across = ax * by - ay * bx
    return (a_m * by - b_m * ay) / across, (ax * b_m - bx * a_m) / across


def _straight(sides: Sequence[Side], x: float, y: float, sign: float) -> float:
    """Return the way [m] ahead (`sign` 1) or back (-1) on which a point comes inside all sides; not above 0 where it is
    inside; inf for never.
    """
    begins_m, ends_m = -inf, inf
    for nx, ny, far_m in sides:
        beyond_m, ahead = nx * x + ny * y - far_m, sign * nx
        if ahead > 1e-9:
            begins_m = max(begins_m, beyond_m / ahead)
        elif ahead < -1e-9:
            ends_m = min(ends_m, beyond_m / ahead)
        elif beyond_m >= 0.0:
            return inf
    return begins_m if begins_m < ends_m and ends_m > 0.0 else inf


def _turned(
    sides: Sequence[Side], center_y: float, angle: float, apart_m: float, direction: float, within_rad: float
) -> float:
    """Return the angle [rad] by which a point, `apart_m` from (0, `center_y`) in direction `angle`, turns about it
    until it is inside all sides; 0 where it is, inf for never or not before `within_rad`.
    """
    barred = []
    for nx, ny, far_m in sides:
        inside = (far_m - ny * center_y) / apart_m
        if inside <= -1.0:
            return inf
        if inside < 1.0:
            barred.append((atan2(ny, nx), acos(inside)))
    turned_rad, again = 0.0, True
    while again:
        again = False
        for normal, half_rad in barred:
            off_rad = direction * wrap(angle + direction * turned_rad - normal)
            if -half_rad <= off_rad <= half_rad:
                turned_rad += half_rad - off_rad + PAST_RAD
                again = True
                if turned_rad >= min(TAU, within_rad):
                    return inf
    return turned_rad
