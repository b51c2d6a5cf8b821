"""Route past obstacles known from an earlier run (the paper's iteration 2), for a team in column.

At each station the route is shifted sideways so that the team approaches as few known obstacles as possible. The
sequence of shifts has the least cost: distance costs its length, a blocked station what a detour there would cost. It
is found by dynamic programming, backwards from the goal.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import atan2, cos, hypot, inf, sin

from lfa.protocol.geometry import Pose2D

STATION_M = 0.5
SHIFT_M = 0.1
"""Change [m] of the shift between two stations, at most: a gentle bend that followers can follow."""
SHIFTS = 20
"""Number of shifts to either side."""
ROOM_M = 0.35
"""Clearance [m] between a body and a known obstacle: its position is uncertain, and detours begin at less."""
BARRED_COST_M = 1.0
SHIFTED_COST = 0.02
"""Cost of each station per metre of shift: leads back to the route where nothing is in the way."""

Point = tuple[float, float]
Circle = tuple[float, float, float]


def past_known(points: Sequence[Point], known: Sequence[Circle], radius_m: float) -> list[Point]:
    """Return way-points from the first of `points` to the last; `known` are x, y, radius [m] in `map`."""
    stations = _stations(points)
    barred = [[_barred(s, n * SHIFT_M, known, radius_m) for n in range(-SHIFTS, SHIFTS + 1)] for s in stations]
    shifts = _cheapest(barred)
    if not any(shifts):
        return list(points)
    shifted = [_beside(s, n * SHIFT_M) for s, n in zip(stations, shifts, strict=True)]
    bends = [
        i
        for i in range(1, len(shifts) - 1)
        if shifts[i + 1] - shifts[i] != shifts[i] - shifts[i - 1] or stations[i + 1].theta != stations[i].theta
    ]
    return [points[0], *(shifted[i] for i in bends), points[-1]]


def _stations(points: Sequence[Point]) -> list[Pose2D]:
    found: list[Pose2D] = []
    for (ax, ay), (bx, by) in pairwise(points):
        length_m = hypot(bx - ax, by - ay)
        steps = max(1, round(length_m / STATION_M))
        heading = atan2(by - ay, bx - ax)
        found += [Pose2D(ax + (bx - ax) * n / steps, ay + (by - ay) * n / steps, heading) for n in range(steps)]
    return [*found, Pose2D(*points[-1], found[-1].theta)]


def _cheapest(barred: Sequence[Sequence[bool]]) -> list[int]:
    """Return the shift at each station, in steps; 0 at the first and the last."""
    sides = range(-SHIFTS, SHIFTS + 1)
    costs = {n: 0.0 if n == 0 else inf for n in sides}
    chosen: list[dict[int, int]] = []
    for row in reversed(barred[:-1]):
        before = {n: min((costs.get(n + d, inf) + _step_m(d), abs(n + d), n + d) for d in (-1, 0, 1)) for n in sides}
        chosen.append({n: before[n][2] for n in sides})
        costs = {
            n: before[n][0] + BARRED_COST_M * row[n + SHIFTS] + SHIFTED_COST * SHIFT_M * abs(n) for n in sides
        }  # fmt: skip
    found = [0]
    for following in reversed(chosen):
        found.append(following[found[-1]])
    return found


def _step_m(change: int) -> float:
    return hypot(STATION_M, change * SHIFT_M)


def _barred(station: Pose2D, shift_m: float, known: Sequence[Circle], radius_m: float) -> bool:
    x, y = _beside(station, shift_m)
    return any(hypot(x - kx, y - ky) < kr + radius_m + ROOM_M for kx, ky, kr in known)


def _beside(station: Pose2D, shift_m: float) -> Point:
    return station.x - sin(station.theta) * shift_m, station.y + cos(station.theta) * shift_m
