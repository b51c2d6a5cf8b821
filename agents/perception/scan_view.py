"""What a scan has looked through: the proof that something has moved is a place that was seen free."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot

from msgspec import Struct

from lfa.agents.perception.scan import Point

BEHIND_M = 0.1
"""Distance [m] behind a place up to which a scan may show nothing for the place to count as seen free."""
BESIDE_STEPS, BESIDE_RAD = 1.05, 0.02
"""Angle beside a place in which that holds: this number of steps between two beams, so that the beams on both sides of
the place count (along a wall the one beyond it looks past it), and this much [rad] at least."""


class ScanView(Struct, frozen=True, gc=False):
    """Scan in `map`: where it was seen from, what it showed, its range [m], and the angle [rad] between its beams."""

    eye: Point
    points: Sequence[Point]
    reach_m: float
    step_rad: float

    def shows_free(self, place: Point) -> bool:
        """Return whether the scan looked through `place`: at what is behind it, or at nothing in its direction."""
        px, py = place[0] - self.eye[0], place[1] - self.eye[1]
        far_m = hypot(px, py)
        if far_m > self.reach_m - BEHIND_M:
            return False
        beside = max(BESIDE_RAD, BESIDE_STEPS * self.step_rad) * far_m
        for x, y in self.points:
            qx, qy = x - self.eye[0], y - self.eye[1]
            if (q_m := hypot(qx, qy)) > far_m + BEHIND_M:
                continue
            if px * qx + py * qy > 0.0 and abs(px * qy - py * qx) < beside * q_m:
                return False
        return True
