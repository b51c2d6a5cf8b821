"""Openings between scan points: the nearest direction in which the robot passes."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, pi, sin

from msgspec import Struct

from lfa.agents.perception.scan import Point
from lfa.protocol.geometry import wrap

STEP_RAD = pi / 24


ASIDE_STEPS, ALL_STEPS = 18, 30
"""Directions up to 135 degrees off the wanted one lead past a thing, the others back; a side once taken reaches beyond
the opposite direction, so that it does not flip there."""


WIDE_M = 0.20
"""Kept from the body's surface where there is room."""


NARROW_M = 0.08
"""Never less (control.md section 7), but beside what the robot is nearer to already."""


BESIDE = 0.25
"""Less than this ahead, as a share of how far aside: beside the robot, which comes no nearer to it than 3 %."""


class Openings(Struct, frozen=True):
    """The open direction nearest to the wanted one on either side, and the one that leads back; None where none is."""

    left: float | None
    right: float | None
    rear: float | None


def first_open(
    points: Sequence[Point], towards: float, side: float, first: int, last: int, reach_m: float, half_width_m: float
) -> float | None:
    """The open direction nearest to `towards` among steps `first` to `last` to one side of it."""
    for n in range(first, last + 1):
        bearing = wrap(towards + side * n * STEP_RAD)
        bar = barring_point(points, bearing, reach_m, half_width_m)
        if bar is None:
            return bearing
        if bar:  # what bars one direction is likely to bar the next
            points = [*points[bar:], *points[:bar]] if side > 0.0 else [*points[bar::-1], *points[:bar:-1]]
    return None


def barring_point(points: Sequence[Point], bearing: float, reach_m: float, half_width_m: float) -> int | None:
    """Which point lies within `half_width_m` of the straight way of `reach_m` in direction `bearing`; None: it is open.

    A point that is already nearer than the half width bars only what goes towards it, not what passes it by.
    """
    c, s, far_m = cos(bearing), sin(bearing), reach_m + half_width_m
    for n, (x, y) in enumerate(points):
        along = c * x + s * y
        if 0.0 < along < far_m:
            across = c * y - s * x
            if -half_width_m < across < half_width_m and along > BESIDE * abs(across):
                return n
    return None
