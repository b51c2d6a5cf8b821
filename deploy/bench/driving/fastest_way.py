"""Grounds that are known from the start, and the shortest time in which a drive could get to the goal there.

No robot gets there sooner than along the shortest way, at the cruise speed but for speeding up and braking at the
drive's limit: bends cost this bound nothing, so that it lies below what is feasible. Its way among obstacles is that of
`shortest_way.py`, at most 3 % too long.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from math import cos, dist, hypot, pi, sin
from random import Random

import numpy as np
from msgspec import Struct

from lfa.deploy.bench.driving.course_file import CRUISE_MPS, Course
from lfa.deploy.bench.driving.shortest_way import shortest_m
from lfa.world.description.maps import Map

LEGS, LEG_M, BEND_RAD = 3, 8.0, pi / 3
"""Number and length of the straights of an open course, and the largest bend between two."""
DISCS, APART_M, ASIDE_M = 8, 2.2, 0.8
"""Number of obstacles, the way [m] from one to the next, and the largest distance [m] of one from the straight line."""
RADII_M = (0.2, 0.5)
RADIUS_M = 0.15
"""Radius [m] of the body."""
CELL_M, EDGE_M = 0.05, 3.0
"""Cell of the map of a cluttered course, and its ground to each side of the line."""


class TimedCourse(Struct, frozen=True):
    """Course, the obstacles on it as circles x, y, radius [m], and the length [m] of its shortest way."""

    course: Course
    known_m: tuple[tuple[float, float, float], ...]
    way_m: float

    @property
    def sets(self) -> tuple[str, ...]:
        """What the mission says of the obstacles, as arguments of `--set`: all of them are known."""
        return (f"mission.leading.known_m={[list(disc) for disc in self.known_m]}",)

    def least_s(self, acceleration_mps2: float) -> float:
        """Return the shortest time [s] from rest to rest."""
        return self.way_m / CRUISE_MPS + CRUISE_MPS / acceleration_mps2


class TimedKind(Struct, frozen=True):
    """Kind of ground: its row's name and bar, and the course that a random generator and the body's radius [m] give."""

    name: str
    ratio_max: float
    draw: Callable[[Random, float], TimedCourse]


def in_the_open(chance: Random, _radius_m: float) -> TimedCourse:
    """Return straights with bends to either side between them."""
    x, y, theta, points = 0.0, 0.0, 0.0, [(0.0, 0.0)]
    for _ in range(LEGS):
        x, y = x + LEG_M * cos(theta), y + LEG_M * sin(theta)
        points.append((x, y))
        theta += chance.uniform(-BEND_RAD, BEND_RAD)
    return TimedCourse(Course(tuple(points)), (), sum(dist(a, b) for a, b in pairwise(points)))


def in_clutter(chance: Random, radius_m: float) -> TimedCourse:
    """Return a straight line with known obstacles on and beside it."""
    discs = tuple(
        (round(3.0 + APART_M * n, 2), round(chance.uniform(-ASIDE_M, ASIDE_M), 2), round(chance.uniform(*RADII_M), 2))
        for n in range(DISCS)
    )
    goal = (3.0 + APART_M * DISCS + 1.0, 0.0)
    obstacles = tuple(f"{{ center_m = [{x:g}, {y:g}], radius_m = {r:g} }}" for x, y, r in discs)
    way_m = shortest_m(_drawn(discs, goal[0]), (0.0, 0.0), goal, radius_m)
    return TimedCourse(Course(((0.0, 0.0), goal), obstacles=obstacles), discs, way_m)


def _drawn(discs: tuple[tuple[float, float, float], ...], length_m: float) -> Map:
    """Return the map of the obstacles."""
    origin = (-1.0, -EDGE_M, 0.0)
    columns, rows = round((length_m + 2.0) / CELL_M), round(2.0 * EDGE_M / CELL_M)
    cells = np.zeros((rows, columns), dtype=np.int16)
    for row in range(rows):
        for column in range(columns):
            x, y = origin[0] + (column + 0.5) * CELL_M, origin[1] + (row + 0.5) * CELL_M
            if any(hypot(x - cx, y - cy) < r for cx, cy, r in discs):
                cells[row, column] = 100
    return Map(cells, CELL_M, origin)


KINDS = (TimedKind("open", 1.15, in_the_open), TimedKind("clutter", 1.35, in_clutter))
