"""Ends of walls that move: the edge of a door that slides or swings out of a wall.

A wall has no track, since its width hides its motion. What moves at its end is told by where it grows to: places that a
scan has looked through just before.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from math import hypot

from lfa.agents.perception.scan import Point
from lfa.agents.perception.scan_view import ScanView

WITHIN_M = 2.5
"""Distance [m] from the robot within which ends are looked at."""
SINCE_S, KEPT_S = 0.25, 0.65
"""Least and greatest age [s] of the scan that is compared with."""
GROWN_M, GROWN_M_MAX = 0.08, 0.8
"""Length [m] by which an end must have grown since that scan, and the most that counts as the same end."""
PROOFS_MIN = 2
"""Number of points at the end that must be in places seen free: one may be a grazing beam."""
MOVING_EDGE_M = 0.1
"""Radius [m] of the disc that stands for a moving edge."""

Moving = tuple[Point, Point]
"""Centre [m] and velocity [m/s] of a moving edge, in `map`."""


class WallEnds:
    """Ends of the walls in the newest scans of one robot."""

    def __init__(self) -> None:
        self._before: deque[tuple[float, list[Point], ScanView]] = deque()
        self.moving: list[Moving] = []
        """Those that moved when the newest scan was made."""

    def update(
        self, walls: Sequence[Sequence[Point]], view: ScanView, mates: Sequence[Point], mate_m: float, now: float
    ) -> None:
        """Update with the points of the `walls` of one scan, each in beam order; what is within `mate_m` [m] of one of
        `mates` may be that team-mate before a wall.
        """
        while self._before and now - self._before[0][0] > KEPT_S:
            self._before.popleft()
        self.moving = []
        for wall in walls:
            for points in (wall, wall[::-1]):
                x, y = points[0]
                if hypot(x - view.eye[0], y - view.eye[1]) > WITHIN_M:
                    continue
                grown = self._grown(points, now)
                if grown is not None and all(hypot(x - mx, y - my) > mate_m for mx, my in mates):
                    self.moving.append(grown)
        self._before.append((now, [end for wall in walls for end in (wall[0], wall[-1])], view))

    def _grown(self, wall: Sequence[Point], now: float) -> Moving | None:
        """Return the edge at the first of the points of `wall`, if the wall has grown there; None otherwise."""
        x, y = wall[0]
        for at, ends, view in reversed(self._before):
            if now - at < SINCE_S or not ends:
                continue
            off_m, (bx, by) = min((hypot(x - ex, y - ey), (ex, ey)) for ex, ey in ends)
            if off_m < GROWN_M:
                continue
            new = [point for point in wall[:PROOFS_MIN] if hypot(point[0] - bx, point[1] - by) < off_m + MOVING_EDGE_M]
            if off_m > GROWN_M_MAX or len(new) < PROOFS_MIN or not all(map(view.shows_free, new)):
                return None
            ux, uy, mps = (x - bx) / off_m, (y - by) / off_m, off_m / (now - at)
            return (x - MOVING_EDGE_M * ux, y - MOVING_EDGE_M * uy), (mps * ux, mps * uy)
        return None
