"""Overlap of the robots' bodies with obstacles and walls, from the ground truth of a run."""

from __future__ import annotations

from math import inf

import numpy as np
from msgspec.structs import replace

from lfa.deploy.analysis.run_data import Run
from lfa.deploy.analysis.tracking_errors import Mask
from lfa.deploy.recording.mcap_reader import Array
from lfa.world.description.placement import gap_to, reach_of

EVERY = 3
"""Step in ground truth records between two checks: a robot moves 6 cm at most in that time."""


def overlap_m(run: Run) -> float:
    """Return the largest overlap [m] of a robot's body with an obstacle or a wall; negative: the narrowest gap."""
    radius_m, world = run.scenario.mission.radius_m, run.scenario.world
    worst = -inf
    for rows in run.truth.values():
        looked = rows[::EVERY]
        for index, obstacle in enumerate(world.obstacles):
            moved = run.seen.obstacles.get(index)
            for row in looked[_near(looked, run, index)]:
                center = obstacle.center_m if moved is None else _at(moved, float(row[0]))
                gap_m = gap_to((float(row[1]), float(row[2])), replace(obstacle, center_m=center))
                worst = max(worst, radius_m - gap_m)
        for x1, y1, x2, y2 in world.walls_m:
            gaps = _to_segment(looked, x1, y1, x2, y2)
            worst = max(worst, radius_m - float(gaps.min()))
    return worst


def outside_m(run: Run, rows: Array) -> float:
    """Return how far [m] a path leaves the bounding box of all walls; 0 inside, inf for a non-finite position."""
    walls = np.array(run.scenario.world.walls_m, dtype=float).reshape(-1, 2)
    places = rows[:, 1:3]
    if not np.isfinite(places).all():
        return inf
    if not walls.size:
        return 0.0
    low, high = walls.min(axis=0), walls.max(axis=0)
    return float(np.maximum(np.maximum(low - places, places - high), 0.0).max())


def _near(rows: Array, run: Run, index: int) -> Mask:
    """Return a mask of the rows near enough to an obstacle for an exact check."""
    obstacle = run.scenario.world.obstacles[index]
    within_m = reach_of(obstacle) + run.scenario.mission.radius_m + 0.3
    moved = run.seen.obstacles.get(index)
    if moved is None:
        x, y = np.full(rows.shape[0], obstacle.center_m[0]), np.full(rows.shape[0], obstacle.center_m[1])
    else:
        x, y = np.interp(rows[:, 0], moved[:, 0], moved[:, 1]), np.interp(rows[:, 0], moved[:, 0], moved[:, 2])
    return np.asarray(np.hypot(rows[:, 1] - x, rows[:, 2] - y) < within_m)


def _at(moved: Array, t: float) -> tuple[float, float]:
    return float(np.interp(t, moved[:, 0], moved[:, 1])), float(np.interp(t, moved[:, 0], moved[:, 2]))


def _to_segment(rows: Array, x1: float, y1: float, x2: float, y2: float) -> Array:
    dx, dy = x2 - x1, y2 - y1
    along = np.clip(((rows[:, 1] - x1) * dx + (rows[:, 2] - y1) * dy) / (dx * dx + dy * dy), 0.0, 1.0)
    return np.asarray(np.hypot(rows[:, 1] - x1 - along * dx, rows[:, 2] - y1 - along * dy))
