"""Way driven, mean speed and least clearance of each robot, from the ground truth of a run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import reduce
from itertools import chain, pairwise
from math import inf

import numpy as np

from lfa.deploy.recording.mcap_reader import Array, RecordedRun
from lfa.world.description.load import Scenario
from lfa.world.description.scenario import Obstacle

Corners = Sequence[tuple[float, float]]

EVERY = 3
"""Step in ground truth records between two checks: a robot moves 6 cm at most in that time."""
MET_M, LEFT_M = 0.5, 0.8
"""Distance [m] from its body at which a robot that plans its way round all that it sees has met an obstacle or a wall,
and from which it has left a wall."""
STARTED_M = 0.05
"""Way [m] after which a robot counts as started: its mean speed counts from there to its last motion."""


def way_m(rows: Array) -> float:
    """Return the way [m] that a robot has driven."""
    return float(np.hypot(*np.diff(rows[:, 1:3], axis=0).T).sum())


def mean_speed_mps(rows: Array) -> float | None:
    """Return the mean speed [m/s] from a robot's start to its last motion; None for one that did not drive."""
    driven = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(rows[:, 1:3], axis=0).T))])
    if driven[-1] < 2.0 * STARTED_M:
        return None
    first, last = np.searchsorted(driven, STARTED_M), np.searchsorted(driven, driven[-1] - 1e-3)
    lasted_s = float(rows[last, 0] - rows[first, 0])
    return float(driven[last] - driven[first]) / lasted_s if lasted_s > 0.0 else None


def least_clearance_m(robot: int, seen: RecordedRun, scenario: Scenario) -> float:
    """Return the least distance [m] from a robot's body to a wall, an obstacle or another robot's body; negative where
    they overlapped, inf in an empty world.
    """
    return min(to_things_m(robot, seen, scenario), _to_mates_m(robot, seen, 2.0 * scenario.mission.radius_m))


def to_things_m(robot: int, seen: RecordedRun, scenario: Scenario) -> float:
    """Return the least distance [m] from a robot's body to a wall or an obstacle, as of `least_clearance_m`."""
    rows = seen.truth[robot][::EVERY]
    gaps = chain(_to_obstacles(rows, seen, scenario), _to_walls(rows, scenario))
    return min((float(gap.min()) for gap in gaps), default=inf)


def things_near(robot: int, seen: RecordedRun, scenario: Scenario) -> dict[str, int]:
    """Return the number of obstacles, `stationary` and `moving` ones, that a robot's body came within `MET_M` of, and
    how many times it came so near to a `wall` and went `LEFT_M` away again.
    """
    near, rows = {"stationary": 0, "moving": 0, "wall": 0}, seen.truth[robot][::EVERY]
    for obstacle, gap in zip(scenario.world.obstacles, _to_obstacles(rows, seen, scenario), strict=True):
        near["moving" if obstacle.moves else "stationary"] += int(gap.min() <= MET_M)
    away = True
    for gap_m in reduce(np.minimum, _to_walls(rows, scenario), np.full(len(rows), inf)).tolist():
        near["wall"] += int(away and gap_m <= MET_M)
        away = gap_m > (MET_M if away else LEFT_M)
    return near


def _to_obstacles(rows: Array, seen: RecordedRun, scenario: Scenario) -> list[Array]:
    """Return the distances [m] of a robot's body from each obstacle's surface."""
    mission, obstacles = scenario.mission, enumerate(scenario.world.obstacles)
    if mission.footprint_m:
        return [_from_polygon(rows, mission.footprint_m, one, seen.obstacles.get(n)) for n, one in obstacles]
    return [_to_obstacle(rows, one, seen.obstacles.get(n)) - mission.radius_m for n, one in obstacles]


def _to_walls(rows: Array, scenario: Scenario) -> Iterator[Array]:
    """Yield the distances [m] of a robot's body from each wall: a map may have thousands."""
    mission, (x, y, theta) = scenario.mission, rows[:, 1:4].T
    for wall in scenario.world.walls_m:
        if mission.footprint_m:
            yield _between(x, y, theta, mission.footprint_m, wall)
        else:
            yield _to_segment(x, y, *wall) - mission.radius_m


def _to_mates_m(robot: int, seen: RecordedRun, touching_m: float) -> float:
    """Return the least distance [m] to another robot's body; robots that started in one place count once apart."""
    own, least = seen.truth[robot], inf
    for other, rows in seen.truth.items():
        n = min(own.shape[0], rows.shape[0])
        apart = np.hypot(own[:n, 1] - rows[:n, 1], own[:n, 2] - rows[:n, 2])
        clear = np.flatnonzero(apart >= touching_m)
        if other != robot and clear.size:
            least = min(least, float(apart[clear[0] :].min()) - touching_m)
    return least


def _to_obstacle(rows: Array, obstacle: Obstacle, moved: Array | None) -> Array:
    """Return the distances [m] of the robot's centre from an obstacle's surface; 0 inside a polygon."""
    x, y = _from_centre(rows, obstacle, moved)
    if obstacle.radius_m is not None:
        return np.asarray(np.hypot(x, y) - obstacle.radius_m)
    return _to_polygon(x, y, obstacle.corners_m or ())


def _from_polygon(rows: Array, body: Corners, obstacle: Obstacle, moved: Array | None) -> Array:
    """Return the distances [m] of a body that is a polygon from an obstacle's surface."""
    x, y = _from_centre(rows, obstacle, moved)
    theta = rows[:, 3]
    if obstacle.radius_m is not None:
        return np.asarray(_to_polygon(*_in_body(x, y, theta, 0.0, 0.0), body) - obstacle.radius_m)
    corners = obstacle.corners_m or ()
    sides = pairwise((*corners, corners[0]))
    return np.asarray(np.min([_between(x, y, theta, body, (*a, *b)) for a, b in sides], axis=0))


def _between(x: Array, y: Array, theta: Array, body: Corners, side: tuple[float, float, float, float]) -> Array:
    """Return the distances [m] between bodies at x, y, theta and the segment `side`: one end of either is nearest."""
    c, s, ends = np.cos(theta), np.sin(theta), (side[:2], side[2:])
    apart = [_to_segment(x + c * cx - s * cy, y + s * cx + c * cy, *side) for cx, cy in body]
    return np.asarray(np.min(apart + [_to_polygon(*_in_body(x, y, theta, *end), body) for end in ends], axis=0))


def _in_body(x: Array, y: Array, theta: Array, at_x: float, at_y: float) -> tuple[Array, Array]:
    """Return where a point is as seen from bodies at x, y, theta."""
    c, s = np.cos(theta), np.sin(theta)
    return c * (at_x - x) + s * (at_y - y), c * (at_y - y) - s * (at_x - x)


def _from_centre(rows: Array, obstacle: Obstacle, moved: Array | None) -> tuple[Array, Array]:
    """Return the robot's places [m] as seen from an obstacle's centre."""
    if moved is None:
        return rows[:, 1] - obstacle.center_m[0], rows[:, 2] - obstacle.center_m[1]
    at = [np.interp(rows[:, 0], moved[:, 0], moved[:, column]) for column in (1, 2)]
    return rows[:, 1] - at[0], rows[:, 2] - at[1]


def _to_polygon(x: Array, y: Array, corners: Corners) -> Array:
    """Return the distances [m] of points from a convex polygon; 0 inside of it."""
    ring = list(pairwise((*corners, corners[0])))
    inside = np.all([(bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0.0 for (ax, ay), (bx, by) in ring], axis=0)
    return np.where(inside, 0.0, np.min([_to_segment(x, y, *a, *b) for a, b in ring], axis=0))


def _to_segment(x: Array, y: Array, x1: float, y1: float, x2: float, y2: float) -> Array:
    dx, dy = x2 - x1, y2 - y1
    along = np.clip(((x - x1) * dx + (y - y1) * dy) / (dx * dx + dy * dy), 0.0, 1.0)
    return np.asarray(np.hypot(x - x1 - along * dx, y - y1 - along * dy))
