"""The ground map: which floor is blocked after which profiles, where its points are, and when a gap is free again."""

from __future__ import annotations

from math import cos, floor, hypot, inf, pi, sin

import pytest

from lfa.agents.perception.ground_map import AGAIN_S, CELL_M, CELLS_MAX, MOVED_M, SEEN_MIN, GroundMap
from lfa.protocol.geometry import Pose2D, in_base
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import GroundProfile
from lfa.protocol.mission import Limits

LIMITS = Limits()
FIRST_M, STEP_M, LINE_M = 0.2, 0.025, 0.15
DEEP_M, LOW_M = 0.05, 0.008
WIDE, NARROW = 8, 1
"""Readings of a hole that wheels do not bridge, and of one that they do."""
EVERY_S = 0.05


def profile(*holes: tuple[int, int, float], lines: tuple[int, ...] = (1,)) -> GroundProfile:
    """A floor with (first reading, readings, height [m]) of each hole or bump on `lines`, flat elsewhere."""
    heights = [[0.0] * 40 for _ in range(3)]
    for line in lines:
        for first, count, height in holes:
            heights[line][first : first + count] = [height] * count
    offsets = (LINE_M, 0.0, -LINE_M)
    return GroundProfile(Header("robot1", 1, 1, 0.0), FIRST_M, STEP_M, offsets, tuple(map(tuple, heights)))


HOLE = profile((4, WIDE, -DEEP_M))
"""A hole on the middle line from 0.3 m to 0.5 m ahead."""


def told(floor: GroundProfile, times: int = SEEN_MIN, pose: Pose2D | None = None) -> GroundMap:
    """A map that was told of a floor so many times, at `pose`."""
    ground = GroundMap(LIMITS)
    for n in range(times):
        ground.profile(floor, pose or Pose2D(), EVERY_S * n)
    return ground


def near(points: list[tuple[float, float]], x: float, y: float) -> bool:
    """Whether a point lies within a cell of (x, y)."""
    return any(hypot(px - x, py - y) < 1.5 * CELL_M for px, py in points)


def test_a_hole_blocks_once_enough_profiles_have_shown_it() -> None:
    assert told(HOLE, SEEN_MIN - 1).points(Pose2D(), 2.0) == []
    points = told(HOLE).points(Pose2D(), 2.0)
    assert near(points, 0.32, 0.0)
    assert near(points, 0.48, 0.0)
    assert all(0.25 < x < 0.55 and abs(y) < 2.0 * CELL_M for x, y in points)


def test_single_profiles_with_time_between_them_are_bad_readings() -> None:
    ground = GroundMap(LIMITS)
    for n in range(2 * SEEN_MIN):
        ground.profile(HOLE, Pose2D(), 1.1 * AGAIN_S * n)
    assert ground.points(Pose2D(), 2.0) == []


@pytest.mark.parametrize("pose", [Pose2D(2.0, 1.0, pi / 2), Pose2D(-1.0, -3.0, 2.5)])
def test_blocked_points_stay_in_map_and_are_told_in_the_robots_own_frame(pose: Pose2D) -> None:
    ground = told(HOLE, pose=pose)
    middle = (pose.x + 0.4 * cos(pose.theta), pose.y + 0.4 * sin(pose.theta))
    assert near(ground.points(pose, 2.0), 0.4, 0.0)
    moved = Pose2D(pose.x + 0.1, pose.y - 0.2, pose.theta + 1.0)
    assert near(ground.points(moved, 2.0), *in_base(moved, middle))


def test_only_what_is_nearer_than_asked_is_told_also_after_the_robot_has_moved() -> None:
    ground = told(HOLE)
    assert ground.points(Pose2D(), 0.25) == []
    assert all(hypot(*point) < 0.4 for point in ground.points(Pose2D(), 0.4))
    for pose in (Pose2D(-1.0, 0.0, 0.0), Pose2D(0.4, 1.0, 0.0), Pose2D(0.4, -1.0, 0.0)):
        assert ground.points(pose, 0.8) == []
        beside = Pose2D(0.5 * (pose.x + 0.4), 0.5 * pose.y, 0.0)
        assert near(ground.points(beside, 0.8), 0.4 - beside.x, -beside.y)


def test_a_robot_that_moves_a_little_knows_what_comes_into_reach() -> None:
    ground = told(HOLE)
    assert ground.points(Pose2D(-0.9 * MOVED_M, 0.0, 0.0), 0.45) == []
    assert ground.points(Pose2D(), 0.45) != []


def test_a_hole_is_doubtful_from_its_first_profile_on_and_only_in_the_newest() -> None:
    ground = told(HOLE, 1)
    assert ground.doubtful(Pose2D(0.1, 0.0, 0.0)) == [pytest.approx((0.2, 0.0))]
    ground.profile(profile(), Pose2D(), 1.0)
    assert ground.doubtful(Pose2D()) == []


def test_what_wheels_cross_and_single_readings_are_not_doubtful() -> None:
    for harmless in (profile((4, WIDE, -LOW_M)), profile((4, NARROW, -DEEP_M)), profile((4, NARROW, DEEP_M))):
        assert told(harmless, 1).doubtful(Pose2D()) == []


def test_the_nearest_crossable_feature_that_two_profiles_show_is_ahead() -> None:
    floor = profile((4, 2, LOW_M), (12, 2, LOW_M))
    assert told(floor, 1).ahead is None
    ahead = told(floor, 2).ahead
    assert ahead is not None
    assert (ahead.kind, ahead.near_m) == ("bump", pytest.approx(0.3))


@pytest.mark.parametrize("off_m", [0.04, -0.04])
def test_a_crossable_feature_is_known_again_a_cell_further_on_and_not_after_a_while(off_m: float) -> None:
    floor = profile((4, 2, LOW_M))
    for place, later_s, known in (
        (Pose2D(off_m, off_m, 0.0), EVERY_S, True),
        (Pose2D(off_m, -off_m, 0.0), EVERY_S, True),
        (Pose2D(5.0 * off_m, 0.0, 0.0), EVERY_S, False),
        (Pose2D(0.0, 5.0 * off_m, 0.0), EVERY_S, False),
        (Pose2D(), 1.1 * AGAIN_S, False),
    ):
        ground = told(floor, 1, Pose2D(0.025, 0.025, 0.0))
        ground.profile(floor, Pose2D(place.x + 0.025, place.y + 0.025, 0.0), later_s)
        assert (ground.ahead is not None) == known, place


def test_a_gap_that_had_seemed_too_wide_is_free_once_two_lines_show_that_it_is_bridged() -> None:
    ground = told(profile((4, 3, -DEEP_M), lines=(0, 1)))
    assert ground.points(Pose2D(), 2.0) != []
    for n in range(2):
        ground.profile(profile((5, 2, -DEEP_M), lines=(0, 1)), Pose2D(), 1.0 + EVERY_S * n)
    assert ground.points(Pose2D(), 2.0) == []


def test_a_gap_on_one_line_alone_frees_nothing() -> None:
    ground = told(profile((4, 3, -DEEP_M)))
    for n in range(2):
        ground.profile(profile((5, 2, -DEEP_M)), Pose2D(), 1.0 + EVERY_S * n)
    assert ground.points(Pose2D(), 2.0) != []


def test_a_hole_without_a_visible_end_is_judged_from_nearby() -> None:
    assert told(profile((20, 20, -inf))).points(Pose2D(), 2.0) == []
    assert told(profile((8, 32, -inf))).points(Pose2D(), 2.0) != []


def test_holes_on_all_lines_with_a_straight_edge_are_a_ditch() -> None:
    assert told(profile((4, WIDE, -DEEP_M), lines=(0, 1, 2))).nearest(0.4, 0.0, 0.5) == ("ditch", pytest.approx(0.2))
    assert told(HOLE).nearest(0.4, 0.0, 0.5) == ("pothole", pytest.approx(0.2))


@pytest.mark.parametrize(("x", "y"), [(1.0, 2.0), (-1.3, 0.4), (0.7, -2.1)])
def test_a_circle_is_blocked_all_round_and_at_once(x: float, y: float) -> None:
    ground = GroundMap(LIMITS)
    ground.bar_circle(x, y, 0.3, "wall", 0.0)
    points = ground.points(Pose2D(x, y, 0.0), 1.0)
    assert all(abs(hypot(*point) - 0.3) < CELL_M for point in points)
    for n in range(24):
        assert near(points, 0.3 * cos(n * pi / 12), 0.3 * sin(n * pi / 12)), n
    assert len(points) >= 2.0 * pi * 0.3 / CELL_M * 0.7


def test_the_nearest_blocked_floor_within_reach_has_a_kind_and_a_width() -> None:
    ground = GroundMap(LIMITS)
    for x, y, radius_m, kind in ((1.0, 2.0, 0.1, "wall"), (1.0, -2.0, 0.2, "bump"), (-1.5, 0.0, 0.3, "ditch")):
        ground.bar_circle(x, y, radius_m, kind, 0.0)  # type: ignore[arg-type]
    assert ground.nearest(1.0, 1.5, 1.0) == ("wall", 0.2)
    assert ground.nearest(1.0, -1.5, 1.0) == ("bump", 0.4)
    assert ground.nearest(-0.9, 0.0, 1.0) == ("ditch", 0.6)
    assert ground.nearest(0.0, 0.0, 1.0) is None
    assert ground.nearest(1.0, 1.2, 0.6) is None
    assert ground.nearest(0.0, 2.0, 1.2) == ("wall", 0.2)
    assert told(HOLE, SEEN_MIN - 1).nearest(0.4, 0.0, 0.5) is None


def test_a_bridged_gap_frees_its_own_cells_and_those_around_them_and_no_others() -> None:
    ground, cells = GroundMap(LIMITS), [(i, j) for i in range(2, 12) for j in range(-4, 8)]
    for i, j in cells:
        ground.bar_circle((i + 0.5) * CELL_M, (j + 0.5) * CELL_M, 1e-3, "pothole", 0.0)
    for n in range(2):
        ground.profile(profile((5, NARROW, -DEEP_M), lines=(0, 1)), Pose2D(0.01, 0.01, 0.0), 1.0 + EVERY_S * n)
    xs = {floor((0.01 + FIRST_M + STEP_M * n) / CELL_M) for n in (5, 6)}
    ys = {floor((0.01 + y) / CELL_M) for y in (LINE_M, 0.0)}
    free = {(x + dx, y + dy) for x in xs for y in ys for dx in (-1, 0, 1) for dy in (-1, 0, 1)}
    seen = {(i, j) for i, j in cells if ground.nearest((i + 0.5) * CELL_M, (j + 0.5) * CELL_M, 0.01) is None}
    assert seen == free


@pytest.mark.parametrize(
    ("first", "then", "within_m"),
    [
        pytest.param((-1.5, 0.5), (-0.1, 0.5), 0.6, id="along x alone"),
        pytest.param((-1.0, 0.5), (1.0, 0.5), 0.8, id="to the other side of the axis y"),
        pytest.param((0.4, -0.6), (0.4, 0.6), 0.7, id="to the other side of the axis x"),
    ],
)
def test_what_is_near_is_looked_up_anew_after_a_way(
    first: tuple[float, float], then: tuple[float, float], within_m: float
) -> None:
    ground = told(HOLE, pose=Pose2D(0.0, 0.5, 0.0))
    assert ground.points(Pose2D(*first, 0.0), within_m) == []
    assert ground.points(Pose2D(*then, 0.0), within_m) != []


def test_a_hole_on_a_circle_that_was_blocked_as_a_wall_blocks_without_walls_and_after_it_is_freed() -> None:
    ground = told(HOLE)
    holes = ground.points(Pose2D(), 1.0)
    ground.bar_circle(0.0, 0.0, 0.4, "wall", 1.0)
    assert ground.points(Pose2D(), 1.0, walls=False) == holes
    ground.free_circle(0.0, 0.0, 0.4)
    assert ground.points(Pose2D(), 1.0) == holes


def test_what_is_asked_for_farther_off_is_looked_up_anew() -> None:
    ground = told(HOLE)
    ground.points(Pose2D(), 0.1)
    assert near(ground.points(Pose2D(), 2.0), 0.48, 0.0)


def test_what_is_blocked_while_the_robot_stands_is_known_at_once() -> None:
    ground = GroundMap(LIMITS)
    assert ground.points(Pose2D(), 1.0) == []
    ground.bar_circle(0.5, 0.0, 0.1, "wall", 0.0)
    assert ground.points(Pose2D(), 1.0) != []


def test_a_map_has_a_bounded_number_of_blocked_cells() -> None:
    ground = GroundMap(LIMITS)
    ground.bar_circle(0.0, 0.0, 40.0, "wall", 0.0)
    assert len(ground.points(Pose2D(), 50.0)) == CELLS_MAX
