"""Openings between scan points: the nearest direction in which the robot can pass."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, pi, sin

from msgspec import Struct

from lfa.agents.perception.scan import Point
from lfa.protocol.geometry import wrap

STEP_RAD = pi / 24
ASIDE_STEPS, ALL_STEPS = 18, 30
"""Steps of `STEP_RAD`: directions up to 135 degrees off the wanted one lead past an obstacle, the others back. Once a
side is taken, it reaches beyond the opposite direction, so that it does not flip there."""
WIDE_M = 0.20
"""Clearance [m] to the body's surface where there is room."""
NARROW_M = 0.08
"""Minimum clearance [m] (control.md section 7), except beside obstacles that are nearer already."""
BESIDE = 0.25
"""Ratio of forward to lateral distance below which a point counts as beside the robot, which comes at most 3 % nearer
to it."""


class Openings(Struct, frozen=True):
    """Open direction nearest to the wanted one on either side, and the one that leads back; None where there is
    none.
    """

    left: float | None
    right: float | None
    rear: float | None


def first_open(
    points: Sequence[Point], towards: float, side: float, first: int, last: int, reach_m: float, half_width_m: float
) -> float | None:
    """Return the open direction nearest to `towards` among steps `first` to `last` to one side of it."""
    for n in range(first, last + 1):
        bearing = wrap(towards + side * n * STEP_RAD)
        bar = barring_point(points, bearing, reach_m, half_width_m)
        if bar is None:
            return bearing
        if bar:  # a point that bars one direction is likely to bar the next
            points = [*points[bar:], *points[:bar]] if side > 0.0 else [*points[bar::-1], *points[:bar:-1]]
    return None


def barring_point(points: Sequence[Point], bearing: float, reach_m: float, half_width_m: float) -> int | None:
    """Return the index of a point within `half_width_m` of the straight way of `reach_m` in direction `bearing`, or
    None.

    A point that is already nearer than the half width bars only motion towards it, not motion past it.
    """
    c, s, far_m = cos(bearing), sin(bearing), reach_m + half_width_m
    for n, (x, y) in enumerate(points):
        along = c * x + s * y
        if 0.0 < along < far_m:
            across = c * y - s * x
            if -half_width_m < across < half_width_m and along > BESIDE * abs(across):
                return n
    return None
