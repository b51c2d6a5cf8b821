"""Way past obstacles for a planner that knows the world: does one exist?"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

CELL_M = 0.05
ABOVE_M = 1.0
"""Free ground [m] beyond the goal that a way may use."""


class Corridor(NamedTuple):
    """Walls [m] to both sides, from `bottom_m` to `top_m`, with one across the bottom."""

    left_m: float
    right_m: float
    bottom_m: float
    top_m: float


def way_exists(
    start: tuple[float, float],
    goal: tuple[float, float],
    discs: Sequence[tuple[float, float, float]],
    corridor: Corridor,
    robot_m: float,
) -> bool:
    """Return True if a robot of radius `robot_m` can get from `start` to `goal` [m] past all `discs` (x, y, radius).

    A flood over cells of `CELL_M`; above the walls of the corridor the ground is free.
    """
    xs = np.arange(corridor.left_m, corridor.right_m, CELL_M)
    ys = np.arange(corridor.bottom_m, goal[1] + ABOVE_M, CELL_M)
    x, y = np.meshgrid(xs, ys, indexing="ij")
    free = (y > corridor.top_m + robot_m) | ((x - corridor.left_m > robot_m) & (corridor.right_m - x > robot_m))
    for cx, cy, radius_m in discs:
        free &= np.hypot(x - cx, y - cy) > radius_m + robot_m
    here = np.hypot(x - start[0], y - start[1]) <= CELL_M
    there = np.hypot(x - goal[0], y - goal[1]) <= CELL_M
    reached = here & free
    while True:
        wider = reached.copy()
        wider[1:] |= reached[:-1]
        wider[:-1] |= reached[1:]
        wider[:, 1:] |= reached[:, :-1]
        wider[:, :-1] |= reached[:, 1:]
        wider &= free
        if (wider & there).any():
            return True
        if (wider == reached).all():
            return False
        reached = wider
