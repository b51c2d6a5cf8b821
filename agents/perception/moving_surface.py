"""What moves at a wall: the edge of a door that comes out of it, or a thing that passes close along it.

A wall has no track, for its width hides motion, and what is near to one joins it in the scan. What moves there is told
by where surfaces are now: in places that a scan has looked through just before. From the nearest surface of that scan
to the one now it has moved.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from math import hypot

from msgspec import Struct

from lfa.agents.perception.scan import Point
from lfa.agents.perception.scan_view import ScanView

WITHIN_M = 2.5
"""Distance [m] from the robot within which surfaces are looked at."""
SINCE_S, KEPT_S = 0.25, 0.65
"""Least and greatest age [s] of the scans that are compared with."""
MOVED_M, MPS_MAX = 0.08, 2.0
"""Distance [m] by which a surface must have moved since, and the most speed [m/s] that counts as motion: what is
farther from all that was seen has come into sight."""
POINTS_MIN = 2
"""Number of neighbouring points that must have moved: one may be a grazing beam."""
RADIUS_M = 0.1
"""Least radius [m] of the disc that stands for what moves."""


class MovingSurface(Struct, frozen=True, gc=False):
    """Disc that stands for a surface that moves, in `map`: centre and radius [m], velocity [m/s]."""

    x: float
    y: float
    radius_m: float
    vx: float
    vy: float


class SurfaceWatch:
    """Watch of one robot for surfaces of walls that move."""

    def __init__(self) -> None:
        self._before: deque[tuple[float, ScanView]] = deque()
        self.moving: list[MovingSurface] = []
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
        before = [(at, seen) for at, seen in self._before if now - at >= SINCE_S]
        if before:
            for wall in walls:
                self._find(wall, view.eye, before, mates, mate_m, now)
        self._before.append((now, view))

    def _find(
        self,
        wall: Sequence[Point],
        eye: Point,
        before: Sequence[tuple[float, ScanView]],
        mates: Sequence[Point],
        mate_m: float,
        now: float,
    ) -> None:
        """Add what of `wall` is in places that all scans `before` show free: a thin wall may hide end-on in one."""
        (at, newest), run = before[-1], list[Point]()
        for point in (*wall, None):
            if (
                point is not None
                and hypot(point[0] - eye[0], point[1] - eye[1]) <= WITHIN_M
                and newest.shows_free(point)
                and all(view.shows_free(point) for _, view in before[:-1])
                and all(hypot(point[0] - x, point[1] - y) > mate_m for x, y in mates)
            ):
                run.append(point)
            elif run:
                found = _moved(run, newest, now - at)
                self.moving += [] if found is None else [found]
                run = []


def _moved(run: Sequence[Point], before: ScanView, since_s: float) -> MovingSurface | None:
    """Return the surface of the neighbouring points `run`, if it has moved from one that `before` shows; else None."""
    if len(run) < POINTS_MIN or not before.points:
        return None
    ways = []
    for x, y in run:
        way_m, (bx, by) = min((hypot(x - bx, y - by), (bx, by)) for bx, by in before.points)
        ways.append((way_m, x - bx, y - by))
    way_m, dx, dy = max(ways)
    if not MOVED_M <= way_m <= MPS_MAX * since_s:
        return None
    radius_m = max(RADIUS_M, 0.5 * hypot(run[0][0] - run[-1][0], run[0][1] - run[-1][1]))
    x, y = sum(x for x, _ in run) / len(run), sum(y for _, y in run) / len(run)
    back = (radius_m - 0.5 * way_m) / way_m
    return MovingSurface(x - back * dx, y - back * dy, radius_m, dx / since_s, dy / since_s)
