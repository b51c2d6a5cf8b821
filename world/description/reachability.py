"""Reachability of a route: a scenario whose walls separate a way-point from the start is refused.

Only walls count, and only what is certain is refused: a gap of which the grid cannot tell whether the body passes
counts as one that it passes. The test is a flood fill, run only if a wall is nearer to a straight leg of the route than
the body's radius: most scenarios cost nothing. Where the first grid is too coarse to tell, finer ones follow.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from itertools import pairwise
from math import ceil, floor, hypot

from lfa.world.description.placement import to_segment

Point = tuple[float, float]
Segment = tuple[float, float, float, float]

CELLS_M = (0.1, 0.05, 0.025)
"""Sizes [m] of a grid's cells, coarsest first."""
BAND = 0.6
"""Distance to a wall, in cells, below which a cell's centre is blocked whatever the radius, so that no wall leaks: of
two cells side by side with a wall between them, one is nearer to its points.
"""
ROUNDED = 0.71
"""Half of a cell's diagonal, in cells: no farther than this lies the centre of the cell that holds a point."""
SURE = 1.0
"""Distance, in cells, that a cell's centre must be farther from a wall than the radius to be passed for certain."""
CELLS_MAX = 4_000_000
FINER_CELLS_MAX = 600_000
"""Greatest number of cells of the first grid, and of a finer one."""
RIM_M = 0.5
BESIDE_M = 1.0
"""Distance [m] within which a free place stands for a way-point on which no body fits (`agents/leading/free_place.py`).
"""


def parted(route: Sequence[Point], walls: Sequence[Segment], robot_m: float = 0.0) -> Point | None:
    """Return the first point of `route` that `walls` separate from its first one for a body of radius `robot_m`; None
    if there is none, or if the grid is too large.
    """
    if not any(_beside(a, b, wall, robot_m) for a, b in pairwise(route) for wall in walls):
        return None
    xs = [x for x, _ in route] + [x for wall in walls for x in wall[::2]]
    ys = [y for _, y in route] + [y for wall in walls for y in wall[1::2]]
    low, high = (min(xs) - RIM_M, min(ys) - RIM_M), (max(xs) + RIM_M, max(ys) + RIM_M)
    missed = None
    for cell_m in CELLS_M:
        ground = _Ground(low, high, cell_m)
        if ground.columns * ground.rows > (CELLS_MAX if cell_m == CELLS_M[0] else FINER_CELLS_MAX):
            return missed
        ground.bar(walls, max(BAND * cell_m, robot_m - ROUNDED * cell_m))
        missed = _missed(ground, route, walls, robot_m)
        if missed is not None and robot_m >= (BAND + ROUNDED) * cell_m:
            return missed
        if missed is None:
            ground.bar(walls, robot_m + SURE * cell_m)
            if _missed(ground, route, walls, robot_m) is None:
                return None
    return missed


def _missed(ground: _Ground, route: Sequence[Point], walls: Sequence[Segment], robot_m: float) -> Point | None:
    """Return the first point of `route` that is not reached. For one on which the body does not fit, a place beside it
    will do; the last one is the goal, and has none.
    """
    ground.flood(route[0])
    for point in route[1:]:
        fits = point == route[-1] or all(to_segment(point, wall[:2], wall[2:]) >= robot_m for wall in walls)
        if not ground.reached(point, 0.0 if fits else BESIDE_M):
            return point
    return None


class _Ground:
    """Grid of free and blocked cells for the flood fill."""

    def __init__(self, low: Point, high: Point, cell_m: float) -> None:
        self._low, self._cell_m = low, cell_m
        self.columns, self.rows = (ceil((high[n] - low[n]) / cell_m) + 1 for n in (0, 1))
        self._taken = bytearray()
        self._flooded = bytearray()

    def bar(self, walls: Sequence[Segment], band_m: float) -> None:
        """Block the cells whose centres are nearer than `band_m` to `walls`, the rim, and no others."""
        self._taken = bytearray(self.columns * self.rows)
        for column in range(self.columns):
            self._taken[column] = self._taken[(self.rows - 1) * self.columns + column] = 1
        for row in range(self.rows):
            self._taken[row * self.columns] = self._taken[(row + 1) * self.columns - 1] = 1
        for wall in walls:
            self._bar_beside(wall, band_m)

    def flood(self, start: Point) -> None:
        """Reach all free cells that hang together with that of `start`."""
        taken, columns, first = self._taken, self.columns, self._cell(start)
        reached = self._flooded = bytearray(len(taken))
        waiting = deque([first])
        reached[first] = 1
        while waiting:
            cell = waiting.popleft()
            for beside in (cell - 1, cell + 1, cell - columns, cell + columns):
                if not (taken[beside] or reached[beside]):
                    reached[beside] = 1
                    waiting.append(beside)

    def reached(self, point: Point, within_m: float) -> bool:
        """Return whether the flood has reached a cell within `within_m` of that of `point`, or one next to it."""
        cell, reach = self._cell(point), max(1, round(within_m / self._cell_m))
        row, column = divmod(cell, self.columns)
        for r in range(max(0, row - reach), min(self.rows, row + reach + 1)):
            for c in range(max(0, column - reach), min(self.columns, column + reach + 1)):
                if hypot(r - row, c - column) <= reach and self._flooded[r * self.columns + c]:
                    return True
        return False

    def _cell(self, point: Point) -> int:
        column, row = (floor((point[n] - self._low[n]) / self._cell_m) for n in (0, 1))
        return row * self.columns + column

    def _bar_beside(self, wall: Segment, band_m: float) -> None:
        x1, y1, x2, y2 = (value - self._low[n % 2] for n, value in enumerate(wall))
        length_m = hypot(x2 - x1, y2 - y1)
        steps = max(1, ceil(length_m / (0.5 * self._cell_m)))
        reach = ceil(band_m / self._cell_m)
        for n in range(steps + 1):
            x, y = (x1 + (x2 - x1) * n / steps) / self._cell_m, (y1 + (y2 - y1) * n / steps) / self._cell_m
            column, row = floor(x), floor(y)
            for r in range(max(0, row - reach), min(self.rows, row + reach + 1)):
                for c in range(max(0, column - reach), min(self.columns, column + reach + 1)):
                    if hypot(c + 0.5 - x, r + 0.5 - y) * self._cell_m < band_m:
                        self._taken[r * self.columns + c] = 1


def _beside(a: Point, b: Point, wall: Segment, within_m: float) -> bool:
    """Return whether `wall` crosses the straight leg from `a` to `b`, or is nearer to it than `within_m`."""
    c, d = wall[:2], wall[2:]
    if _left(a, b, c) * _left(a, b, d) <= 0.0 and _left(c, d, a) * _left(c, d, b) <= 0.0:
        return True
    ends = [to_segment(p, c, d) for p in (a, b)] + ([to_segment(p, a, b) for p in (c, d)] if a != b else [])
    return min(ends) < within_m


def _left(a: Point, b: Point, p: Point) -> float:
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
