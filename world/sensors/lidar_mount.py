"""Scans as seen from `base_link`, wherever on the robot the scanner is: what a robot publishes is in its own frame.

A scanner at the centre keeps its beams, turned by its mounting angle. From elsewhere each reading becomes a point, and
the nearest point of each direction a beam; directions without a reading are bad beams (nan, REP-117).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, hypot, isfinite, nan, pi, sin
from typing import NamedTuple

from lfa.protocol.geometry import TAU
from lfa.world.description.scenario import Lidar

BEAMS_MIN = 720
"""Least number of directions of a scan whose readings were moved: half of one is the error of their bearing."""


class BaseScan(NamedTuple):
    """Scan as seen from `base_link`: angle of its first beam [rad], step [rad], longest range [m], ranges [m]."""

    angle_min: float
    step: float
    range_max_m: float
    ranges_m: tuple[float, ...]


def seen_from_base(ranges_m: Sequence[float], lidar: Lidar) -> BaseScan:
    """Return the scan that the beams of `lidar` make, as seen from `base_link`."""
    turn, (x, y, theta) = lidar.beams_a_turn, lidar.mount
    step = TAU / turn
    first = -pi + (turn - lidar.beams + 1) // 2 * step + theta
    if x == y == 0.0:
        return BaseScan(first, step, lidar.range_max_m, tuple(ranges_m))
    count = max(turn, BEAMS_MIN)
    beams = [nan] * count
    for n, reading in enumerate(ranges_m):
        angle = first + n * step
        bearing, seen = angle, reading
        if isfinite(reading):
            px, py = x + reading * cos(angle), y + reading * sin(angle)
            bearing, seen = atan2(py, px), hypot(px, py)
        place = int((bearing + pi) / TAU * count + 0.5) % count
        if not beams[place] <= seen:  # nan is no reading, and gives way to any
            beams[place] = seen
    return BaseScan(-pi, TAU / count, lidar.range_max_m + hypot(x, y), tuple(beams))
