"""A world as a grid of cells: what is taken, and a way through what is free. Also written as a ROS map."""

from __future__ import annotations

from collections.abc import Sequence
from heapq import heappop, heappush
from math import ceil, hypot, inf, sqrt

import numpy as np
import numpy.typing as npt

from lfa.protocol.errors import Refused
from lfa.world.description import maps
from lfa.world.description.maps import Map, Segment
from lfa.world.description.scenario import Obstacle, Point

RIM_M = 1.0
"""Free ground [m] around all that stands."""
CELLS_MAX = 100_000
Taken = npt.NDArray[np.bool_]
Cell = tuple[int, int]
"""Row and column."""
STEPS = [(r, c, sqrt(abs(r) + abs(c))) for r in (-1, 0, 1) for c in (-1, 0, 1) if r or c]


def grid_of(
    walls: Sequence[Segment], obstacles: Sequence[Obstacle], more: Sequence[Point], cell_m: float, cells_max: int
) -> Map:
    """Return the map of what stands, with the points `more` in it; cells are larger than `cell_m` [m] in a large world.

    Raises Refused for a world without any extent.
    """
    points = [*more, *((x, y) for x1, y1, x2, y2 in walls for x, y in ((x1, y1), (x2, y2)))]
    for obstacle in obstacles:
        (x, y), r = obstacle.center_m, obstacle.radius_m or 0.0
        corners = obstacle.corners_m or ((-r, -r), (r, r))
        points += [(x + dx, y + dy) for dx, dy in corners]
    if not points:
        raise Refused("nothing stands in it: must have a wall or an obstacle")
    x0, y0 = min(x for x, _ in points) - RIM_M, min(y for _, y in points) - RIM_M
    wide, high = max(x for x, _ in points) + RIM_M - x0, max(y for _, y in points) + RIM_M - y0
    cell_m = max(cell_m, sqrt(wide * high / cells_max), max(wide, high) / cells_max)
    cells = np.zeros((ceil(high / cell_m), ceil(wide / cell_m)), dtype=np.int16)
    drawn = Map(cells, cell_m, (x0, y0, 0.0))
    for wall in walls:
        _draw_wall(drawn, wall)
    for obstacle in obstacles:
        _draw_obstacle(drawn, obstacle)
    return drawn


def _draw_wall(drawn: Map, wall: Segment) -> None:
    x1, y1, x2, y2 = wall
    steps = max(1, ceil(hypot(x2 - x1, y2 - y1) / (0.5 * drawn.resolution_m)))
    share = np.linspace(0.0, 1.0, steps + 1)
    rows = ((y1 + (y2 - y1) * share - drawn.origin[1]) / drawn.resolution_m).astype(int)
    columns = ((x1 + (x2 - x1) * share - drawn.origin[0]) / drawn.resolution_m).astype(int)
    drawn.cells[rows, columns] = maps.OCCUPIED


def _draw_obstacle(drawn: Map, obstacle: Obstacle) -> None:
    """Mark the cells whose centre an obstacle covers, and those of its outline."""
    (x, y), r, size = obstacle.center_m, obstacle.radius_m, drawn.resolution_m
    reach = r if r is not None else max(hypot(*corner) for corner in obstacle.corners_m or ())
    low_r, low_c = (max(0, int((v - reach - o) / size)) for v, o in ((y, drawn.origin[1]), (x, drawn.origin[0])))
    high_r, high_c = (int((v + reach - o) / size) + 1 for v, o in ((y, drawn.origin[1]), (x, drawn.origin[0])))
    part = drawn.cells[low_r:high_r, low_c:high_c]
    dy = (np.arange(low_r, low_r + part.shape[0]) + 0.5)[:, None] * size + drawn.origin[1] - y
    dx = (np.arange(low_c, low_c + part.shape[1]) + 0.5)[None, :] * size + drawn.origin[0] - x
    if r is not None:
        part[dx * dx + dy * dy <= r * r] = maps.OCCUPIED
        drawn.cells[int((y - drawn.origin[1]) / size), int((x - drawn.origin[0]) / size)] = maps.OCCUPIED
        return
    ring = obstacle.corners_m or ()
    inside = np.ones(part.shape, dtype=bool)
    for (ax, ay), (bx, by) in zip(ring, (*ring[1:], ring[0]), strict=True):
        inside &= (bx - ax) * (dy - ay) - (by - ay) * (dx - ax) >= 0.0
        _draw_wall(drawn, (x + ax, y + ay, x + bx, y + by))
    part[inside] = maps.OCCUPIED


def widened(drawn: Map, by_m: float) -> Taken:
    """Return the cells within `by_m` [m] of an occupied one, and those of the rim."""
    reach = ceil(by_m / drawn.resolution_m)
    occupied = np.pad(drawn.occupied, reach)
    rows, columns = drawn.cells.shape
    taken = np.zeros((rows, columns), dtype=bool)
    for r in range(-reach, reach + 1):
        for c in range(-reach, reach + 1):
            if hypot(max(abs(r) - 0.5, 0.0), max(abs(c) - 0.5, 0.0)) * drawn.resolution_m <= by_m:
                taken |= occupied[reach + r : reach + r + rows, reach + c : reach + c + columns]
    taken[[0, -1], :] = taken[:, [0, -1]] = True
    return taken


def ways_from(taken: Taken, start: Cell) -> tuple[npt.NDArray[np.float64], dict[Cell, Cell]]:
    """Return the length [cells] of the shortest way from `start` to each free cell, and the cell before each on it."""
    length = np.full(taken.shape, inf)
    before: dict[Cell, Cell] = {}
    length[start] = 0.0
    waiting = [(0.0, start)]
    while waiting:
        gone, (row, column) = heappop(waiting)
        if gone > length[row, column]:
            continue
        for r, c, step in STEPS:
            cell = row + r, column + c
            if not taken[cell] and gone + step < length[cell]:
                length[cell] = gone + step
                before[cell] = row, column
                heappush(waiting, (gone + step, cell))
    return length, before


def way_to(before: dict[Cell, Cell], goal: Cell) -> list[Cell]:
    """Return the cells from the start to `goal`."""
    cells = [goal]
    while cells[-1] in before:
        cells.append(before[cells[-1]])
    return cells[::-1]


def is_clear(taken: Taken, a: Cell, b: Cell) -> bool:
    """Return True if no taken cell lies on the straight line between two cells."""
    steps = max(1, 2 * max(abs(a[0] - b[0]), abs(a[1] - b[1])))
    share = np.linspace(0.0, 1.0, steps + 1)
    rows = np.rint(a[0] + (b[0] - a[0]) * share).astype(int)
    columns = np.rint(a[1] + (b[1] - a[1]) * share).astype(int)
    return not bool(taken[rows, columns].any())


def center_of(drawn: Map, cell: Cell) -> Point:
    """Return the centre x, y [m] of a cell, in `map`."""
    return drawn.to_map((cell[1] + 0.5) * drawn.resolution_m, (cell[0] + 0.5) * drawn.resolution_m)
