"""Costmap of one search: the cost of each step, fixed for the search while the map itself may change.

Unknown ground can be driven at an extra cost. Near occupied cells the cost grows, so that a path keeps to the middle
where there is room.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import ceil, hypot, inf

from lfa.agents.exploration.occupancy_grid import CELL_M, NEAR_PER_CELL, REACH, Grid, Point

FREE, UNSEEN = 10, 13
"""Cost of a straight step on free and on unknown ground; a diagonal step costs `DIAGONAL` / `STRAIGHT` as much."""
STRAIGHT, DIAGONAL = 5, 7
SKIN_M = 0.04
"""Margin [m] beyond the radius and half a cell between the path and the centre of an occupied cell where there is
room."""
TIGHT_M = 0.05
"""Depth [m] below the radius at which a cell is barred: an occupied cell's surface may be farther away than its centre,
and the way through a cell may lead beside its centre, so that a nearer bar would close gaps that the body passes."""
CLOSE = 60
"""Extra cost of a step just not touching an obstacle; it falls with the square of the clearance gained."""
TIGHT = 240
"""Cost of the tightest step: worth a detour of some 24 times its length, since the body may not fit."""
ROOM_M = 0.45
"""Clearance [m] beyond which the cost does not fall any more."""
BARRED = 1000
"""Cost of a point where no robot can be."""
SETTLE_CELLS = 6
"""Distance [cells] up to which a free cell is searched around a blocked start or goal."""

Box = tuple[float, float, float, float]
"""Box x1, y1, x2, y2 [m] in `map`."""


class Costmap:
    """Costmap of one search. `near` is a copy of the grid's nearness, so that cells are blocked for this search
    only.
    """

    def __init__(self, grid: Grid, prices: bytes) -> None:
        """Create a costmap of `grid` with `prices` as returned by `prices_of`."""
        self.grid = grid
        self.prices = prices
        self.near = bytearray(grid.near)

    def bar_runs(self, runs: Sequence[tuple[int, int]]) -> None:
        """Block the cells of `runs` (`runs_of`)."""
        for low, high in runs:
            self.near[low:high] = bytes([NEAR_PER_CELL * REACH]) * (high - low)

    def bar(self, center: Point, apart_m: float, own: Point) -> None:
        """Block the cells within `apart_m` [m] of `center`, except around the robot itself at `own`."""
        grid, cell = self.grid, self.grid.cell(*center)
        if cell is None:
            return
        reach = min(REACH, int(apart_m / CELL_M))
        for row in range(-reach, reach + 1):
            for column in range(-reach, reach + 1):
                if hypot(row, column) * CELL_M <= apart_m:
                    place = cell + row * grid.columns + column
                    x, y = grid.center(place)
                    if hypot(x - own[0], y - own[1]) > 2.0 * CELL_M:
                        self.near[place] = NEAR_PER_CELL * REACH

    def settled(self, point: Point) -> int | None:
        """Return the nearest cell to `point` in which a robot can stand, within `SETTLE_CELLS`; None if there is
        none.
        """
        cell = self.grid.cell(*point)
        if cell is None:
            return None
        reach = range(-SETTLE_CELLS, SETTLE_CELLS + 1)
        around = (
            (row * row + column * column, cell + row * self.grid.columns + column) for row in reach for column in reach
        )
        return min((pair for pair in around if self.prices[self.near[pair[1]]] > 0), default=(0, None))[1]

    def price(self, point: Point) -> int:
        """Return the cost of a step to `point`; `BARRED` where no robot can be."""
        cell = self.grid.cell(*point)
        price = 0 if cell is None else self.prices[self.near[cell]]
        return price or BARRED

    def price_of_cells(self, cells: Sequence[int]) -> int:
        """Return the cost of a chain of neighbouring cells, as the search computes it."""
        near, prices, scores, straight = self.near, self.prices, self.grid.scores, (1, self.grid.columns)
        return sum(
            (prices[near[cell]] + (UNSEEN - FREE if scores[cell] == 0 else 0))
            * (STRAIGHT if abs(cell - last) in straight else DIAGONAL)
            for last, cell in pairwise(cells)
        )

    def price_of_line(self, a: Point, b: Point) -> float:
        """Return the cost of the straight line, in proportion to its length; inf when it is blocked."""
        total, count = 0, 0
        for x, y in between(a, b):
            cell = self.grid.cell(x, y)
            price = 0 if cell is None else self.prices[self.near[cell]]
            if cell is None or price == 0:
                return inf
            total += price + (UNSEEN - FREE if self.grid.scores[cell] == 0 else 0)
            count += 1
        return STRAIGHT * total / count * hypot(b[0] - a[0], b[1] - a[1]) / CELL_M


def prices_of(radius_m: float, half_width_m: float | None = None) -> bytes:
    """Return the cost of a straight step for each nearness; 0 is blocked.

    `half_width_m` is what a polygon within the circle needs to either side of a straight way; None: the body is round.
    """
    close_m = radius_m + 0.5 * CELL_M + SKIN_M
    barred_m = (radius_m if half_width_m is None else half_width_m) - TIGHT_M
    prices = []
    for near in range(256):
        clear_m = (REACH - near / NEAR_PER_CELL) * CELL_M
        lacking = min(1.0, max(0.0, (close_m + ROOM_M - clear_m) / ROOM_M))
        tight = max(0.0, (close_m - clear_m) / (close_m - barred_m))
        price = FREE + CLOSE * lacking * lacking + (TIGHT - FREE - CLOSE) * min(tight, 1.0)
        prices.append(0 if near and clear_m < barred_m - 1e-9 else round(price))
    return bytes(prices)


def between(a: Point, b: Point) -> Iterator[Point]:
    """Return points from `a` to `b`, one every cell's length, without `a`."""
    steps = max(1, ceil(hypot(b[0] - a[0], b[1] - a[1]) / CELL_M))
    return ((a[0] + (b[0] - a[0]) * n / steps, a[1] + (b[1] - a[1]) * n / steps) for n in range(1, steps + 1))


def runs_of(grid: Grid, box: Box) -> Iterator[tuple[int, int]]:
    """Yield the cells of a box as runs of indices."""
    x1, y1, x2, y2 = box
    low = max(0, int((x1 - grid.x0_m) / CELL_M)), max(0, int((y1 - grid.y0_m) / CELL_M))
    high = min(grid.columns, ceil((x2 - grid.x0_m) / CELL_M)), min(grid.rows, ceil((y2 - grid.y0_m) / CELL_M))
    if low[0] < high[0]:
        for row in range(low[1], high[1]):
            yield row * grid.columns + low[0], row * grid.columns + high[0]
