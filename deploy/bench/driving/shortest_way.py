"""Length of the shortest way on a known map, as a reference for teams that do not know it."""

from __future__ import annotations

from heapq import heappop, heappush
from itertools import product
from math import ceil, hypot, inf

import numpy as np
import numpy.typing as npt

from lfa.world.description.maps import Map

CELL_M = 0.1
"""Greatest size [m] of a cell of the search; a map's larger cells are divided."""
STEPS = tuple(
    (dr, dc, hypot(dr, dc))
    for dr, dc in product((-2, -1, 0, 1, 2), repeat=2)
    if {abs(dr), abs(dc)} in ({0, 1}, {1}, {1, 2})
)
"""Moves of a king and a knight of chess: a way on them is at most 3 % longer than the shortest one."""


def shortest_m(drawn: Map, start: tuple[float, float], goal: tuple[float, float], robot_m: float) -> float:
    """Return the length [m] of the shortest way of a robot of radius `robot_m` (A*); inf if there is none.

    Cells of unknown ground are free, as the world has no walls there.
    """
    parts = max(1, ceil(drawn.resolution_m / CELL_M))
    cells = np.kron(drawn.cells, np.ones((parts, parts), dtype=np.int16))
    fine = Map(cells, drawn.resolution_m / parts, drawn.origin, drawn.occupied_thresh)
    barred = _grown(fine.occupied, robot_m / fine.resolution_m)
    first, last = fine.cell_of(*start), fine.cell_of(*goal)
    if first is None or last is None:
        return inf
    best, waiting = {first: 0.0}, [(0.0, first)]
    rows, columns = barred.shape
    while waiting:
        _, here = heappop(waiting)
        if here == last:
            return best[here] * fine.resolution_m
        for dr, dc, length in STEPS:
            row, column = here[0] + dr, here[1] + dc
            if not (0 <= row < rows and 0 <= column < columns) or barred[row, column]:
                continue
            cost = best[here] + length
            if cost < best.get((row, column), inf):
                best[row, column] = cost
                heappush(waiting, (cost + hypot(row - last[0], column - last[1]), (row, column)))
    return inf


def _grown(occupied: npt.NDArray[np.bool_], cells: float) -> npt.NDArray[np.bool_]:
    """Return the cells nearer than `cells` to the edge of an occupied one."""
    reach, (rows, columns) = ceil(cells), occupied.shape
    wide = np.pad(occupied, reach)
    grown = occupied.copy()
    for dr, dc in product(range(-reach, reach + 1), repeat=2):
        if hypot(max(abs(dr) - 0.5, 0.0), max(abs(dc) - 0.5, 0.0)) < cells:
            grown |= wide[reach + dr : reach + dr + rows, reach + dc : reach + dc + columns]
    return grown
