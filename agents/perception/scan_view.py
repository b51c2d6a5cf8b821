"""What a scan has looked through: the proof that something has moved is a place that was seen free."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from math import atan2, hypot, pi

from lfa.agents.perception.scan import Point

BEHIND_M = 0.1
"""Distance [m] behind a place up to which a scan may show nothing for the place to count as seen free."""
BESIDE_STEPS, BESIDE_RAD = 1.05, 0.02
"""Angle beside a place in which that holds: this number of steps between two beams, so that the beams on both sides of
the place count (along a wall the one beyond it looks past it), and this much [rad] at least."""


class ScanView:
    """Scan in `map`: where it was seen from, what it showed, its range [m], and the angle [rad] between its beams."""

    def __init__(self, eye: Point, points: Sequence[Point], reach_m: float, step_rad: float) -> None:
        self.eye = eye
        self.points = points
        self._reach_m = reach_m
        self._beside_rad = max(BESIDE_RAD, BESIDE_STEPS * step_rad)

    @cached_property
    def _sectors(self) -> dict[int, list[tuple[Point, float]]]:
        """Points relative to the eye with their distances [m], by direction in steps of `_beside_rad`."""
        sectors: dict[int, list[tuple[Point, float]]] = {}
        (x, y), width = self.eye, self._beside_rad
        for px, py in self.points:
            dx, dy = px - x, py - y
            sectors.setdefault(int((atan2(dy, dx) + pi) / width), []).append(((dx, dy), hypot(dx, dy)))
        return sectors

    def shows_free(self, place: Point) -> bool:
        """Return whether the scan looked through `place`: at what is behind it, or at nothing in its direction."""
        px, py = place[0] - self.eye[0], place[1] - self.eye[1]
        far_m, width, sectors = hypot(px, py), self._beside_rad, self._sectors
        if far_m > self._reach_m - BEHIND_M:
            return False
        sector, last = int((atan2(py, px) + pi) / width), int(2.0 * pi / width)
        around = {sector - 1, sector, sector + 1}
        if sector <= 1 or sector >= last - 1:  # the last sector is a part of one, and next to the first
            around |= {0, 1, last - 1, last}
        for one in around:
            for (qx, qy), q_m in sectors.get(one, ()):
                if q_m > far_m + BEHIND_M:
                    continue
                if px * qx + py * qy > 0.0 and abs(px * qy - py * qx) < width * far_m * q_m:
                    return False
        return True
