"""Smoothing of a search's cells into a drivable route: straight where that costs nothing, with rounded corners.

The functions are generators, like the search: each step yields the work done so far.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import ceil, hypot

from lfa.agents.exploration.costmap import FREE, STRAIGHT, Costmap
from lfa.agents.exploration.occupancy_grid import Point

PIECE_M = 0.4
"""Distance [m] between the points of a route; a cut corner is rounded over several of them."""
SMOOTHINGS = 12
CUT_MAX = 48
"""Maximum number of path cells that one shortcut replaces."""


def straightened(costmap: Costmap, cells: Sequence[int]) -> Iterator[tuple[int, list[Point]]]:
    """Replace cells by straight shortcuts that do not cost more; yield the work and the points so far."""
    grid = costmap.grid
    at = 0
    points = [grid.center(cells[0])]
    while at < len(cells) - 1:
        looked, to, span = 0, at + 1, min(CUT_MAX, len(cells) - 1 - at)
        while span > 1:
            looked += 2 * span
            straight = costmap.price_of_line(grid.center(cells[at]), grid.center(cells[at + span]))
            if straight <= costmap.price_of_cells(cells[at : at + span + 1]) + 0.5 * FREE * STRAIGHT:
                to = at + span
                break
            span //= 2
        a, b = grid.center(cells[at]), grid.center(cells[to])
        pieces = max(1, ceil(hypot(b[0] - a[0], b[1] - a[1]) / PIECE_M))
        points += [(a[0] + (b[0] - a[0]) * n / pieces, a[1] + (b[1] - a[1]) * n / pieces) for n in range(1, pieces + 1)]
        at = to
        yield looked, points


def smoothed(costmap: Costmap, points: list[Point]) -> Iterator[list[Point]]:
    """Move each point to the middle of its neighbours, as far as that does not bring it nearer to a wall; yield the
    points.
    """
    for _ in range(SMOOTHINGS):
        for n in range(1, len(points) - 1):
            (ax, ay), (x, y), (bx, by) = points[n - 1 : n + 2]
            moved = 0.5 * x + 0.25 * (ax + bx), 0.5 * y + 0.25 * (ay + by)
            if costmap.price(moved) <= max(costmap.price((x, y)), FREE + 6):
                points[n] = moved
        yield points
