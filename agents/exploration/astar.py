"""A* search, a few cells at a time: backward for the cost to go, and forward by that cost on a newer map.

A search from the goal to the robot detects an enclosed goal after its own small region, not after the rest of the map,
and leaves the cost to go of each cell that it expanded. A later search from the robot takes this cost as its heuristic,
as in Adaptive A* (Koenig and Likhachev 2005): it expands little more than its way and what the map shows otherwise
since. Searches are generators that yield the number of cells expanded, so they continue in the next tick where the
budget ended this one.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from heapq import heappop, heappush

from lfa.agents.exploration.costmap import DIAGONAL, FREE, STRAIGHT, UNSEEN, Costmap
from lfa.agents.exploration.occupancy_grid import REACH, Grid

GUESS = 11
"""Heuristic cost of a step: a little above `FREE`, so that unknown ground is not searched in its whole width."""
DEEP, GONE = 65, 64
"""Weights of the cost to go and of the cost so far in a forward search: of the many ways that cost the same, one is
searched to its end first."""
LOOKED_PER_YIELD = 16
LONG_CELLS, ROOM_CELLS_MAX = 12_000, 60_000
"""Number of expanded cells after which a search checks whether the robot is enclosed, and the size in cells of the
largest region for which that is checked."""
FORWARD_CELLS_MAX = 30_000
"""Number of expanded cells after which a forward search is given up: a backward one finds a new cost to go."""

_NEIGHBOURS = tuple((row, column) for row in (-1, 0, 1) for column in (-1, 0, 1) if row or column)


class CostToGo:
    """Cost to go to `goal` (a cell) of each cell that a backward search reached; an estimate of the others'."""

    def __init__(self, grid: Grid, goal: int) -> None:
        self.goal = goal
        self.cost = memoryview(bytearray(4 * len(grid.near))).cast("i")
        """Cost of each cell that was reached, plus 1; 0: not reached."""
        self.expanded = bytearray(len(grid.near))
        """1 for each cell whose cost is final: its neighbours have been reached."""
        self._columns = grid.columns
        self._goal_row, self._goal_column = divmod(goal, grid.columns)
        self._found: tuple[int, int, int] = (0, self._goal_row, self._goal_column)
        """Cost of the cell that was searched for, its row and column."""

    def found(self, start: int) -> None:
        """Take note that the search has reached `start`: all cells that it left aside cost more."""
        self._found = self.cost[start], *divmod(start, self._columns)

    def beyond(self, row: int, column: int) -> int:
        """Return the estimate for a cell that was not reached: the cost of a straight way to the goal or, if that is
        more, what was found, less half of a free way from where the search ended to this cell. Less the whole of it, a
        lower bound, the search would spread to all sides over ground on which nothing has changed.
        """
        cost, found_row, found_column = self._found
        left = cost - FREE * _octile(row - found_row, column - found_column) // 2
        straight = GUESS * _octile(row - self._goal_row, column - self._goal_column)
        return straight if straight > left else left


def search(costmap: Costmap, start: int, to_go: CostToGo) -> Generator[int, None, bool]:
    """Search backward from the goal of `to_go` to `start`; yield cells expanded, return True if there is a way."""
    looked_at, asked = 0, False
    for looked in _spread(costmap, start, to_go):
        looked_at += abs(looked)
        yield abs(looked)
        if looked < 0:
            to_go.found(start)
            return True
        if looked_at > LONG_CELLS and not asked:
            asked = True
            if (yield from _closed_in(costmap, start, to_go.goal)):
                break
    return False


def _spread(costmap: Costmap, start: int, to_go: CostToGo) -> Iterator[int]:
    """Expand A* from the goal. The last number yielded is negative when `start` was reached; otherwise no cell is
    left.
    """
    grid, near, prices, goal = costmap.grid, costmap.near, costmap.prices, to_go.goal
    columns, scores = grid.columns, grid.scores
    steps = _steps(columns)
    best, closed = to_go.cost, to_go.expanded
    start_row, start_column = divmod(start, columns)
    row_max, column_max = grid.rows - REACH, columns - REACH
    unseen, beyond = UNSEEN - FREE, DIAGONAL - STRAIGHT
    heap = [goal]
    best[goal] = 1
    looked = 0
    while heap:
        cell = heappop(heap) & 0xFFFFFF
        if closed[cell]:
            continue
        closed[cell] = 1
        if cell == start:
            yield -1 - looked
            return
        looked += 1
        if looked == LOOKED_PER_YIELD:
            yield looked
            looked = 0
        row, column = divmod(cell, columns)
        if not (REACH <= row < row_max and REACH <= column < column_max):
            continue
        cost = best[cell]
        south, west = start_row - row, start_column - column
        for _, offset, length, up, right in steps:
            other = cell + offset
            if closed[other]:
                continue
            price = prices[near[other]]
            if price == 0:
                continue
            if scores[other] == 0:
                price += unseen
            total = cost + length * price
            known = best[other]
            if known == 0 or total < known:
                best[other] = total
                dr, dc = abs(south - up), abs(west - right)
                far = STRAIGHT * dr + beyond * dc if dr > dc else STRAIGHT * dc + beyond * dr
                heappush(heap, (total + GUESS * far) << 24 | other)
    yield looked


def forward(costmap: Costmap, start: int, to_go: CostToGo) -> Generator[int, None, list[int]]:
    """Search forward from `start` to the goal of `to_go`; yield cells expanded, return the way's cells; none where no
    way is left, or none that is found within `FORWARD_CELLS_MAX`.
    """
    grid, near, prices, goal = costmap.grid, costmap.near, costmap.prices, to_go.goal
    columns, scores = grid.columns, grid.scores
    steps = _steps(columns)
    known, beyond = to_go.cost, to_go.beyond
    came, closed = bytearray(len(near)), bytearray(len(near))
    best = memoryview(bytearray(4 * len(near))).cast("i")
    row_max, column_max = grid.rows - REACH, columns - REACH
    unseen = UNSEEN - FREE
    heap = [start]
    best[start] = 1
    looked = looked_at = 0
    while heap and looked_at < FORWARD_CELLS_MAX:
        cell = heappop(heap) & 0xFFFFFF
        if closed[cell]:
            continue
        closed[cell] = 1
        if cell == goal:
            yield looked
            return _chain(came, columns, start, goal)
        looked += 1
        if looked == LOOKED_PER_YIELD:
            yield looked
            looked_at += looked
            looked = 0
        row, column = divmod(cell, columns)
        if not (REACH <= row < row_max and REACH <= column < column_max):
            continue
        cost, price = best[cell], prices[near[cell]]
        if scores[cell] == 0:
            price += unseen
        for number, offset, length, up, right in steps:
            other = cell + offset
            if closed[other] or prices[near[other]] == 0:
                continue
            total = cost + length * price
            before = best[other]
            if before == 0 or total < before:
                best[other] = total
                came[other] = number
                left = known[other] or beyond(row + up, column + right)
                heappush(heap, (GONE * total + DEEP * left) << 24 | other)
    yield looked
    return []


def _chain(came: bytearray, columns: int, start: int, goal: int) -> list[int]:
    """Return the cells from `start` to `goal`, by reversing each step of the search."""
    offsets, cells = [offset for _, offset, *_ in _steps(columns)], [goal]
    while cells[-1] != start:
        cells.append(cells[-1] - offsets[came[cells[-1]] - 1])
    return cells[::-1]


def _closed_in(costmap: Costmap, start: int, goal: int) -> Generator[int, None, bool]:
    """Return whether the region around the robot ends before the goal, which a long search would find out last."""
    near, prices, columns, rows = costmap.near, costmap.prices, costmap.grid.columns, costmap.grid.rows
    seen = bytearray(len(near))
    seen[start] = 1
    cells = [start]
    for looked, cell in enumerate(cells, start=1):
        if cell == goal or len(cells) > ROOM_CELLS_MAX:
            return False
        row, column = divmod(cell, columns)
        if not (REACH <= row < rows - REACH and REACH <= column < columns - REACH):
            return False
        for other in (cell + 1, cell - 1, cell + columns, cell - columns):
            if not seen[other] and prices[near[other]]:
                seen[other] = 1
                cells.append(other)
        if looked % LOOKED_PER_YIELD == 0:
            yield LOOKED_PER_YIELD
    return True


def _steps(columns: int) -> tuple[tuple[int, int, int, int, int], ...]:
    """Return number from 1, offset, length, row and column of each step to a neighbour."""
    return tuple(
        (number, row * columns + column, DIAGONAL if row and column else STRAIGHT, row, column)
        for number, (row, column) in enumerate(_NEIGHBOURS, start=1)
    )


def _octile(rows: int, columns: int) -> int:
    """Return the length of the shortest way over so many rows and columns, a straight step being `STRAIGHT`."""
    rows, columns = abs(rows), abs(columns)
    if rows > columns:
        return STRAIGHT * rows + (DIAGONAL - STRAIGHT) * columns
    return STRAIGHT * columns + (DIAGONAL - STRAIGHT) * rows
