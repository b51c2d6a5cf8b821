"""The map from one's own scans: walls where they are, clearance as by brute force, and no more work than the budget."""

from __future__ import annotations

from math import cos, floor, hypot, inf, pi, sin

import pytest
from msgspec.structs import replace

from lfa.agents.exploration.occupancy_grid import CELL_M, NEAR_PER_CELL, REACH, Grid, Mapping, Point
from lfa.protocol.geometry import Pose2D
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import LaserScan

BEAMS = 180
HALF_M = 2.03
"""Half the side of a square room around (0, 0)."""


def scan_of_room(
    pose: Pose2D, *, half_m: float = HALF_M, obstacle: tuple[float, float, float] | None = None
) -> LaserScan:
    """Exact ranges in the square room, with a round `obstacle` (x, y, radius) in it."""
    ranges = []
    for n in range(BEAMS):
        angle = pose.theta - pi + n * 2.0 * pi / BEAMS
        c, s = cos(angle), sin(angle)
        walls = [((half_m if d > 0 else -half_m) - p) / d for p, d in ((pose.x, c), (pose.y, s)) if abs(d) > 1e-12]
        r = min(walls)
        if obstacle is not None:
            dx, dy = obstacle[0] - pose.x, obstacle[1] - pose.y
            along, across = c * dx + s * dy, c * dy - s * dx
            if along > 0.0 and abs(across) < obstacle[2]:
                r = min(r, along - (obstacle[2] ** 2 - across**2) ** 0.5)
        ranges.append(r)
    return LaserScan(Header("world", 1, 1, 0.0), -pi, 2.0 * pi / BEAMS, 0.05, 8.0, tuple(ranges))


def mapped(scans: list[tuple[LaserScan, Pose2D]], *, budget: int = 10**6, mates: tuple[Point, ...] = ()) -> Mapping:
    mapping = Mapping((-4.0, -4.0), (4.0, 4.0))
    for scan, pose in scans:
        calls = 0
        while not mapping.scan(scan, pose, mates):
            mapping.work(budget)
            calls += 1
            assert calls < 10_000, f"a scan is not worked in within {calls} calls of {budget} cells"
    for _ in range(1000):
        mapping.work(budget)
    return mapping


def occupied(grid: Grid) -> list[Point]:
    return [grid.center(cell) for cell in range(len(grid.scores)) if grid.occupied(cell)]


def test_what_is_occupied_is_within_one_cell_of_a_wall_and_all_four_walls_are_there() -> None:
    poses = [Pose2D(0.3 * n - 0.6, 0.1 * n, 0.2 * n) for n in range(6)]
    found = occupied(mapped([(scan_of_room(pose), pose) for pose in poses]).grid)
    assert max(abs(max(abs(x), abs(y)) - HALF_M) for x, y in found) <= CELL_M
    for side in range(4):
        along = [(x, y)[side // 2] for x, y in found if abs((y, x)[side // 2] - (-1) ** side * HALF_M) <= CELL_M]
        assert len({floor(place / CELL_M) for place in along}) >= 0.95 * 2.0 * HALF_M / CELL_M


def test_clearance_is_the_distance_to_the_nearest_occupied_cell_also_after_one_has_gone() -> None:
    pose = Pose2D(0.0, 0.0, 0.0)
    with_obstacle = scan_of_room(pose, obstacle=(1.0, 0.4, 0.2))
    scans = [(with_obstacle, pose)] * 2 + [(scan_of_room(pose), pose)] * 20
    grid = mapped(scans).grid
    walls = [divmod(cell, grid.columns) for cell in range(len(grid.scores)) if grid.occupied(cell)]
    for cell in range(0, len(grid.near), 7):
        row, column = divmod(cell, grid.columns)
        nearest = min(hypot(row - r, column - c) for r, c in walls)
        assert grid.near[cell] == max(0, round(NEAR_PER_CELL * (REACH - nearest))), (row, column)


def test_what_has_moved_on_is_forgotten() -> None:
    pose = Pose2D(0.0, 0.0, 0.0)
    seen = mapped([(scan_of_room(pose, obstacle=(1.0, 0.4, 0.2)), pose)])
    assert any(hypot(x - 1.0, y - 0.4) < 0.3 for x, y in occupied(seen.grid))
    later = mapped([(scan_of_room(pose, obstacle=(1.0, 0.4, 0.2)), pose)] + [(scan_of_room(pose), pose)] * 20)
    assert not any(hypot(x - 1.0, y - 0.4) < 0.3 for x, y in occupied(later.grid))


def test_a_team_mate_is_no_obstacle() -> None:
    pose = Pose2D(0.0, 0.0, 0.0)
    grid = mapped([(scan_of_room(pose, obstacle=(1.0, 0.4, 0.15)), pose)], mates=((1.1, 0.4),)).grid
    assert not any(hypot(x - 1.0, y - 0.4) < 0.4 for x, y in occupied(grid))


@pytest.mark.parametrize("budget", [1, 37, 400])
def test_the_map_is_the_same_whatever_the_budget(budget: int) -> None:
    poses = [Pose2D(0.4 * n - 0.4, 0.2 * n, 0.5 * n) for n in range(3)]
    scans = [(scan_of_room(pose), pose) for pose in poses]
    little, much = mapped(scans, budget=budget).grid, mapped(scans).grid
    assert little.scores == much.scores


def test_one_beam_that_does_not_come_back_frees_nothing_behind_the_wall() -> None:
    pose = Pose2D(0.0, 0.0, 0.0)
    scan = scan_of_room(pose)
    lost = LaserScan(
        scan.header, scan.angle_min, scan.angle_increment, 0.05, 8.0,
        tuple(inf if n == 95 else r for n, r in enumerate(scan.ranges_m)),
    )  # fmt: skip
    grid = mapped([(lost, pose)]).grid
    known = [grid.center(cell) for cell, score in enumerate(grid.scores) if score]
    assert max(max(abs(x), abs(y)) for x, y in known) <= HALF_M + CELL_M


def test_a_beam_that_leaves_the_grid_is_followed_to_its_rim() -> None:
    pose = Pose2D(3.0, 3.0, 0.7)
    far = mapped([(scan_of_room(pose, half_m=7.0), pose)])
    assert occupied(far.grid) == []
    assert any(far.grid.scores)


def test_a_range_of_zero_marks_nothing_whatever_the_scanners_minimum_says() -> None:
    """SICK picoScan reports 0.0 for no echo with `range_min` 0.0; a robot must not wall itself in."""
    room = scan_of_room(Pose2D())
    zeros = replace(room, range_min_m=0.0, ranges_m=(0.0,) * BEAMS)
    grid = mapped([(zeros, Pose2D())] * 5).grid
    assert not any(grid.scores)
