"""What a convex polygon sweeps: how far it moves along an arc, or turns on the spot, until it meets a point.

Two circles around `base_link`, the one that holds the polygon and the one inside it, tell most points apart: what the
first one does not meet before the second one has met another need not be compared with the sides.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import acos, atan2, cos, hypot, inf, pi, sin, sqrt
from typing import NamedTuple

from lfa.agents.perception.scan import ROUNDED, STRAIGHT_RADPS, Point, free_along
from lfa.protocol.geometry import TAU, Twist

PAST_RAD = 1e-9
"""Angle [rad] by which a turn is led past the end of what a side bars, so that it is not found there again."""
FEW = 10
"""Number of sides up to which the circle inside costs more than it saves."""
ROUNDING = 1e-6
"""Distance [m] or angle [rad] that covers rounding errors where points are left out."""
RINGS_MAX = 512

Side = tuple[float, float, float]
"""Outward normal x, y of one side of a polygon, and its distance [m] from `base_link`."""
Near = tuple[float, float, float]
"""Square of a point's distance [m^2], and the point in `base_link` [m]: in this order the nearest are first."""


class _Ring(NamedTuple):
    """What a polygon sweeps in a turn: between the squares of two distances [m^2] from the centre. Each side bars what
    is beyond it: its normal's direction [rad], and its distance [m] from the centre.
    """

    near: float
    far: float
    bars: tuple[tuple[float, float], ...]


class Swept:
    """Convex polygon around `base_link` that is moved among points; it holds none of them at the start."""

    def __init__(self, sides: Sequence[Side]) -> None:
        self._sides = tuple(sides)
        self._normals = tuple((atan2(ny, nx), ny, far_m) for nx, ny, far_m in sides)
        """Direction [rad] of each side's normal, its y, and the side's distance [m]."""
        corners = [_corner(sides[n - 1], side) for n, side in enumerate(sides)]
        self._corners = tuple(corners)
        self.reach_m = max(hypot(x, y) for x, y in corners)
        """Distance [m] of the farthest corner."""
        self._core_m = min(far_m for _, _, far_m in sides)
        """Radius [m] of the circle inside the polygon."""
        self._front_m, self._back_m = max(x for x, _ in corners), -min(x for x, _ in corners)
        self._left_m, self._right_m = max(y for _, y in corners), min(y for _, y in corners)
        self._ring = lru_cache(RINGS_MAX)(self._ring_about)

    def beside(self, near: Sequence[Near], curvature: float) -> list[Point]:
        """Return the points that the polygon may meet on an arc of this curvature [1/m], however long."""
        if abs(curvature) <= STRAIGHT_RADPS:
            low, high = self._right_m, self._left_m
            return [(x, y) for _, x, y in near if low < y < high]
        center_y = 1.0 / curvature
        ring, square, twice = self._ring(center_y), center_y * center_y, 2.0 * center_y
        low, high = ring.near - square - ROUNDING, ring.far - square + ROUNDING
        return [(x, y) for far, x, y in near if low < far - twice * y < high]

    def straight(self, points: Sequence[Point], sign: float, within_m: float) -> float:
        """Return the way [m] ahead (`sign` 1) or back (-1) until a point is met; `within_m` if none is before."""
        free_m, left_m, right_m = within_m, self._left_m, self._right_m
        nose_m, rear_m = (self._front_m, self._back_m) if sign > 0.0 else (self._back_m, self._front_m)
        for x, y in points:
            if right_m < y < left_m and -rear_m < sign * x < nose_m + free_m + ROUNDING:
                free_m = min(free_m, _straight(self._sides, x, y, sign))
        return free_m

    def turn(self, points: Sequence[Point], center_y: float, omega: float, within_rad: float) -> float:
        """Return the angle [rad] of a turn about (0, `center_y`), towards the sign of `omega`, until a point is met;
        `within_rad` if none is before.
        """
        ring = self._ring(center_y)
        near, far, bars = ring.near, ring.far, ring.bars
        direction = -1.0 if omega > 0.0 else 1.0  # seen from the body the points turn the other way
        ahead = 1.0 if direction * center_y <= 0.0 else -1.0  # sign of the speed along the arc
        reach, free_rad = self.reach_m * self.reach_m * ROUNDED, within_rad
        bound_rad = self._bound_rad(points, center_y, omega, within_rad) + ROUNDING
        c, s = cos(bound_rad), -direction * sin(bound_rad)  # of the turn to the end of the arc
        for x, y in points:
            beside, square = y - center_y, x * x
            if not near < square + beside * beside < far:
                continue
            if bound_rad < pi and square + y * y > reach:  # the circle around does not hold the point at the start,
                end_x, end_y = c * x + s * beside, c * beside - s * x + center_y
                if (x * ahead <= 0.0 or end_x * ahead >= 0.0) and end_x * end_x + end_y * end_y > reach:
                    continue  # nor at the end, nor in between
            met_rad = _turned(bars, atan2(beside, x), sqrt(square + beside * beside), direction, free_rad)
            if met_rad < free_rad:
                free_rad = met_rad
                if free_rad < bound_rad:
                    bound_rad = free_rad
                    c, s = cos(bound_rad), -direction * sin(bound_rad)
        return free_rad

    def _bound_rad(self, points: Sequence[Point], center_y: float, omega: float, within_rad: float) -> float:
        """Return an angle [rad] that no turn exceeds: that until the circle inside meets a point."""
        if len(self._sides) <= FEW or center_y == 0.0 or self._core_m <= 0.0:
            return min(within_rad, TAU)
        radius_m = abs(center_y)
        arc = Twist(omega * center_y, omega)
        return min(within_rad, TAU, free_along(points, arc, self._core_m, within_rad * radius_m) / radius_m)

    def _ring_about(self, center_y: float) -> _Ring:
        """Return what the polygon sweeps in a turn about (0, `center_y`)."""
        outer_m = max(hypot(x, y - center_y) for x, y in self._corners)
        inner_m = max(0.0, *(ny * center_y - far_m for _, ny, far_m in self._sides))
        # The largest distance beyond a side is a lower bound of that to the polygon: no point that is met is left out.
        bars = tuple((normal, far_m - ny * center_y) for normal, ny, far_m in self._normals)
        return _Ring(inner_m * inner_m / ROUNDED, outer_m * outer_m * ROUNDED, bars)


def _turned(
    bars: Sequence[tuple[float, float]], angle: float, apart_m: float, direction: float, within_rad: float
) -> float:
    """Return the angle [rad] by which a point, `apart_m` from the centre in direction `angle`, turns about it until it
    is inside all sides; 0 where it is, inf for never or not before `within_rad`.
    """
    barred = []
    for normal, offset_m in bars:
        inside = offset_m / apart_m
        if inside <= -1.0:
            return inf
        if inside < 1.0:
            barred.append((normal, acos(inside)))
    turned_rad, again, most_rad = 0.0, True, min(TAU, within_rad)
    while again:
        again = False
        for normal, half_rad in barred:
            off_rad = direction * ((angle + direction * turned_rad - normal + pi) % TAU - pi)
            if -half_rad <= off_rad <= half_rad:
                turned_rad += half_rad - off_rad + PAST_RAD
                again = True
                if turned_rad >= most_rad:
                    return inf
    return turned_rad


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
