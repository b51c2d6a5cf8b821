"""Overlap of the robots' bodies with obstacles and walls, from the ground truth of a run."""

from __future__ import annotations

from math import inf

import numpy as np

from lfa.deploy.analysis.clearance import to_things_m
from lfa.deploy.analysis.run_data import Run
from lfa.deploy.recording.mcap_reader import Array


def overlap_m(run: Run) -> float:
    """Return the largest overlap [m] of a robot's body with an obstacle or a wall; negative: the narrowest gap."""
    return max((-to_things_m(robot, run.seen, run.scenario) for robot in run.truth), default=-inf)


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
