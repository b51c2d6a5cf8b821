"""A* search from the goal to the robot, a few cells at a time.

It searches backwards: an enclosed goal is then detected after its own small region, not after the rest of the map. A
search is a generator that yields the number of cells expanded, so it continues in the next tick where the budget ended
this one.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from heapq import heappop, heappush

from lfa.agents.exploration.costmap import DIAGONAL, FREE, STRAIGHT, UNSEEN, Costmap
from lfa.agents.exploration.occupancy_grid import REACH

GUESS = 11
"""Heuristic cost of a step: a little above `FREE`, so that unknown ground is not searched in its whole width."""
LOOKED_PER_YIELD = 16
LONG_CELLS, ROOM_CELLS_MAX = 12_000, 60_000
"""Number of expanded cells after which a search checks whether the robot is enclosed, and the size in cells of the
largest region for which that is checked."""

_NEIGHBOURS = tuple((row, column) for row in (-1, 0, 1) for column in (-1, 0, 1) if row or column)


def search(costmap: Costmap, start: int, goal: int, toward: bytearray) -> Generator[int, None, bool]:
    """Search a way from `goal` to `start`; yield cells expanded, return True if there is one.

    Each `toward[cell]` becomes the number, from 1, of the step by which the cell was reached.
    """
    looked_at, asked = 0, False
    for looked in _spread(costmap, goal, start, toward):
        looked_at += abs(looked)
        yield abs(looked)
        if looked < 0:
            return True
        if looked_at > LONG_CELLS and not asked:
            asked = True
            if (yield from _closed_in(costmap, start, goal)):
                break
    return False


def chain(toward: bytearray, columns: int, start: int, goal: int) -> list[int]:
    """Return the cells from `start` to `goal`, by reversing each step of the search."""
    offsets, cells = _offsets(columns), [start]
    while cells[-1] != goal:
        cells.append(cells[-1] - offsets[toward[cells[-1]] - 1])
    return cells


def _spread(costmap: Costmap, goal: int, start: int, toward: bytearray) -> Iterator[int]:
    """Expand A* from `goal`. `toward[cell]` becomes the number, from 1, of the step by which the cell was reached. The
    last number yielded is negative when `start` was reached; otherwise no cell is left.
    """
    grid, near, prices = costmap.grid, costmap.near, costmap.prices
    columns, scores = grid.columns, grid.scores
    steps = tuple(
        (number, row * columns + column, DIAGONAL if row and column else STRAIGHT, row, column)
        for number, (row, column) in enumerate(_NEIGHBOURS, start=1)
    )
    best = memoryview(bytearray(4 * len(near))).cast("i")
    closed = bytearray(len(near))
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
        for number, offset, length, up, right in steps:
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
                toward[other] = number
                dr, dc = abs(south - up), abs(west - right)
                far = STRAIGHT * dr + beyond * dc if dr > dc else STRAIGHT * dc + beyond * dr
                heappush(heap, (total + GUESS * far) << 24 | other)
    yield looked


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


def _offsets(columns: int) -> tuple[int, ...]:
    return tuple(row * columns + column for row, column in _NEIGHBOURS)
