"""Motion of moving obstacles: to and fro between points, at constant velocity, or on a random walk.

Collisions do not deflect a moving obstacle. Its position is a function of the world's time alone: the physics engine,
the kinematic model and a test compute the same position.
"""

from __future__ import annotations

from itertools import pairwise
from math import cos, hypot, sin
from random import Random
from typing import Protocol

from lfa.protocol.geometry import TAU
from lfa.world.description.scenario import Obstacle, Point

WALK_LEG_S = 1.0
"""Duration [s] of one leg of a random walk, after which the direction changes."""


class Way(Protocol):
    """Trajectory of a moving obstacle."""

    def at(self, time_s: float) -> Point:
        """Return the position [m] in `map` at the world's time [s]."""


def way_of(obstacle: Obstacle) -> Way:
    """Return the trajectory of a moving `obstacle`."""
    if obstacle.waypoints_m:
        return ToAndFro(obstacle)
    return Walk(obstacle) if obstacle.walk_m is not None else Straight(obstacle)


class ToAndFro:
    """Motion along `center_m` -> `waypoints_m` and back at constant speed."""

    def __init__(self, obstacle: Obstacle) -> None:
        stops = (obstacle.center_m, *obstacle.waypoints_m)
        self._legs = [(a, b, hypot(b[0] - a[0], b[1] - a[1])) for a, b in pairwise(stops) if a != b]
        self._length_m = sum(leg[2] for leg in self._legs)
        self._start_m = obstacle.phase * 2.0 * self._length_m
        self._speed_mps = obstacle.speed_mps

    def at(self, time_s: float) -> Point:
        along = (self._start_m + self._speed_mps * time_s) % (2.0 * self._length_m)
        along = min(along, 2.0 * self._length_m - along)
        leg = 0
        while along > self._legs[leg][2] and leg < len(self._legs) - 1:
            along -= self._legs[leg][2]
            leg += 1
        a, b, length_m = self._legs[leg]
        part = min(along / length_m, 1.0)
        return a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1])


class Straight:
    """Motion from `center_m` at constant velocity, without end."""

    def __init__(self, obstacle: Obstacle) -> None:
        assert obstacle.velocity_mps is not None, obstacle
        self._from_m, self._velocity_mps = obstacle.center_m, obstacle.velocity_mps

    def at(self, time_s: float) -> Point:
        (x, y), (vx, vy) = self._from_m, self._velocity_mps
        return x + vx * time_s, y + vy * time_s


class Walk:
    """Random walk: legs of one second at constant speed; a leg that would end outside heads for the centre instead."""

    def __init__(self, obstacle: Obstacle) -> None:
        assert obstacle.walk_m is not None, obstacle
        self._center_m, self._within_m = obstacle.center_m, obstacle.walk_m
        self._leg_m = obstacle.speed_mps * WALK_LEG_S
        self._chance = Random(obstacle.walk_seed)
        self._turns: list[Point] = [obstacle.center_m]

    def at(self, time_s: float) -> Point:
        leg, part = divmod(time_s / WALK_LEG_S, 1.0)
        while len(self._turns) < leg + 2:
            self._turns.append(self._next(self._turns[-1]))
        a, b = self._turns[int(leg)], self._turns[int(leg) + 1]
        return a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1])

    def _next(self, here: Point) -> Point:
        angle = TAU * self._chance.random()
        to = here[0] + self._leg_m * cos(angle), here[1] + self._leg_m * sin(angle)
        home = self._center_m[0] - here[0], self._center_m[1] - here[1]
        if hypot(to[0] - self._center_m[0], to[1] - self._center_m[1]) <= self._within_m:
            return to
        away_m = hypot(*home)
        return here[0] + self._leg_m * home[0] / away_m, here[1] + self._leg_m * home[1] / away_m
