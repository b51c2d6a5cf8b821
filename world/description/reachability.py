"""Reachability of the goal: a scenario whose walls separate the goal from the start is refused.

Only walls count, and optimistically: a gap that the robot's body hardly passes counts as one that it passes. The test
is a flood fill over cells of `CELL_M`, run only if a wall crosses a straight leg of the route: most scenarios cost
nothing.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from itertools import pairwise
from math import ceil, floor, hypot

Point = tuple[float, float]
Segment = tuple[float, float, float, float]

CELL_M = 0.1
BAND_M = 0.08
"""Distance [m] to a wall below which a cell's centre is blocked: more than 0.71 cells, so that no wall leaks."""
CELLS_MAX = 4_000_000
ROUNDED_M = 0.071
"""Half of a cell's diagonal [m]: no farther than this lies the centre of the cell that holds a point."""
RIM_M = 0.5


def parted(route: Sequence[Point], walls: Sequence[Segment], robot_m: float = 0.0) -> bool:
    """Return True if `walls` separate the first point of `route` from its last for a body of radius `robot_m`; False if
    the grid is too large.
    """
    if not any(_cross(a, b, wall) for a, b in pairwise(route) for wall in walls):
        return False
    xs = [x for x, _ in route] + [x for wall in walls for x in wall[::2]]
    ys = [y for _, y in route] + [y for wall in walls for y in wall[1::2]]
    ground = _Ground(min(xs) - RIM_M, min(ys) - RIM_M, max(xs) + RIM_M, max(ys) + RIM_M)
    if ground.columns * ground.rows > CELLS_MAX:
        return False
    ground.bar(walls, max(BAND_M, robot_m - ROUNDED_M))
    return not ground.flood(route[0], route[-1])


class _Ground:
    """Grid of free and blocked cells for the flood fill."""

    def __init__(self, low_x: float, low_y: float, high_x: float, high_y: float) -> None:
        self._x, self._y = low_x, low_y
        self.columns, self.rows = ceil((high_x - low_x) / CELL_M) + 1, ceil((high_y - low_y) / CELL_M) + 1

    def bar(self, walls: Sequence[Segment], band_m: float) -> None:
        """Block the cells whose centres are nearer than `band_m` to `walls`, and the rim."""
        self._taken = bytearray(self.columns * self.rows)
        for column in range(self.columns):
            self._taken[column] = self._taken[(self.rows - 1) * self.columns + column] = 1
        for row in range(self.rows):
            self._taken[row * self.columns] = self._taken[(row + 1) * self.columns - 1] = 1
        for wall in walls:
            self._bar_beside(wall, band_m)

    def flood(self, start: Point, goal: Point) -> bool:
        """Return True if `goal` is reached from `start`."""
        taken, columns, wanted = self._taken, self.columns, self._cell(goal)
        first = self._cell(start)
        waiting = deque([first])
        taken[first] = 1
        while waiting:
            cell = waiting.popleft()
            if cell == wanted:
                return True
            for beside in (cell - 1, cell + 1, cell - columns, cell + columns):
                if not taken[beside] or beside == wanted:
                    taken[beside] = 1
                    waiting.append(beside)
        return False

    def _cell(self, point: Point) -> int:
        return floor((point[1] - self._y) / CELL_M) * self.columns + floor((point[0] - self._x) / CELL_M)

    def _bar_beside(self, wall: Segment, band_m: float) -> None:
        x1, y1, x2, y2 = wall
        length_m = hypot(x2 - x1, y2 - y1)
        steps = max(1, ceil(length_m / (0.5 * CELL_M)))
        reach = ceil(band_m / CELL_M)
        for n in range(steps + 1):
            x, y = x1 + (x2 - x1) * n / steps - self._x, y1 + (y2 - y1) * n / steps - self._y
            column, row = floor(x / CELL_M), floor(y / CELL_M)
            for r in range(max(0, row - reach), min(self.rows, row + reach + 1)):
                for c in range(max(0, column - reach), min(self.columns, column + reach + 1)):
                    if hypot((c + 0.5) * CELL_M - x, (r + 0.5) * CELL_M - y) < band_m:
                        self._taken[r * self.columns + c] = 1


def _cross(a: Point, b: Point, wall: Segment) -> bool:
    c, d = wall[:2], wall[2:]
    return _left(a, b, c) * _left(a, b, d) <= 0.0 and _left(c, d, a) * _left(c, d, b) <= 0.0


def _left(a: Point, b: Point, p: Point) -> float:
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
