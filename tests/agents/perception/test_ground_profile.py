"""One floor profile: which runs of its readings are a hole or a bump, where they lie, and what wheels can cross."""

from __future__ import annotations

from math import inf, nan, pi

import pytest

from lfa.agents.perception.ground_profile import (
    FLAT_M,
    STRAIGHT_M,
    GroundFeature,
    GroundKind,
    at,
    bridged_lines,
    is_ditch,
    readings_of,
    runs,
)
from lfa.protocol.geometry import Pose2D
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import GroundProfile
from lfa.protocol.mission import Limits

FIRST_M, STEP_M, LEFT_M = 0.5, 0.1, 0.2
LIMITS = Limits()


def seen(*heights: float) -> list[GroundFeature]:
    """What the left line of a profile with these heights [m] shows."""
    return runs(profile(heights), 0)


def profile(heights: tuple[float, ...]) -> GroundProfile:
    return GroundProfile(Header("robot1", 1, 1, 0.0), FIRST_M, STEP_M, (LEFT_M, 0.0, -LEFT_M), (heights,) * 3)


def hole(near_m: float = 1.0, width_m: float = 0.04, size_m: float = 0.05) -> GroundFeature:
    return GroundFeature("pothole", near_m, width_m, size_m)


def close_to(feature: GroundFeature) -> tuple[object, ...]:
    return (feature.kind, *(pytest.approx(value) for value in (feature.near_m, feature.width_m, feature.size_m)))


def test_readings_below_the_floor_are_a_hole_from_its_first_to_its_last() -> None:
    (found,) = seen(0.0, 0.0, -0.03, -0.05, -0.04, -0.07, -0.06, 0.0, 0.0)
    assert close_to(found) == ("pothole", 0.7, 0.5, 0.05)


def test_readings_above_the_floor_are_a_bump_also_right_behind_a_hole() -> None:
    below, above = seen(-0.03, -0.03, 0.02, 0.0)
    assert close_to(below) == ("pothole", 0.5, 0.2, 0.03)
    assert close_to(above) == ("bump", 0.7, 0.1, 0.02)


def test_readings_nearer_to_the_floor_than_noise_are_floor() -> None:
    assert seen(0.9 * FLAT_M, -0.9 * FLAT_M) == []
    assert len(seen(FLAT_M, 0.0, -FLAT_M, 0.0)) == 2


def test_a_missing_reading_neither_begins_nor_ends_a_hole() -> None:
    assert seen(0.0, nan, 0.0) == []
    (found,) = seen(0.0, -0.03, nan, -0.03, 0.0)
    assert close_to(found) == ("pothole", 0.6, 0.3, 0.03)


def test_what_goes_on_beyond_the_last_reading_has_no_far_edge() -> None:
    (found,) = seen(0.0, 0.0, -inf, -inf)
    assert (found.near_m, found.width_m, found.size_m) == (pytest.approx(0.7), inf, inf)


@pytest.mark.parametrize(
    ("kind", "width_m", "size_m", "crossable"),
    [
        ("pothole", LIMITS.bridge_gap_m, inf, True),
        ("pothole", 2.0 * LIMITS.bridge_gap_m, 2.0 * LIMITS.climb_step_m, False),
        ("pothole", inf, LIMITS.climb_step_m, True),
        ("bump", 2.0, LIMITS.climb_step_m, True),
        ("bump", 0.01, 2.0 * LIMITS.climb_step_m, False),
        ("bump", inf, LIMITS.climb_step_m, False),
    ],
)
def test_wheels_cross_a_narrow_gap_and_a_low_step_whose_end_is_in_sight(
    kind: GroundKind, width_m: float, size_m: float, crossable: bool
) -> None:
    assert GroundFeature(kind, 1.0, width_m, size_m).crossable(LIMITS) == crossable


def test_a_point_of_the_robots_own_frame_is_turned_and_moved_into_map() -> None:
    assert at(Pose2D(2.0, 1.0, pi / 2), 0.5, 0.2) == pytest.approx((1.8, 1.5))
    assert at(Pose2D(0.0, 0.0, pi / 6), 1.0, 1.0) == pytest.approx((0.3660254, 1.3660254))


def test_the_readings_of_a_feature_lie_on_its_line_from_edge_to_edge() -> None:
    floor = profile((0.0,) * 8)
    places = readings_of(floor, 0, hole(0.7, 0.2), Pose2D(1.0, 0.0, 0.0))
    assert [x for x, _ in places] == pytest.approx([1.7, 1.8, 1.9])
    assert [y for _, y in places] == pytest.approx([LEFT_M] * 3)


def test_the_readings_of_a_feature_without_a_far_edge_end_with_the_line() -> None:
    places = readings_of(profile((0.0,) * 8), 2, hole(1.0, inf), Pose2D())
    assert [x for x, _ in places] == pytest.approx([1.0, 1.1, 1.2])
    assert {y for _, y in places} == {-LEFT_M}


@pytest.mark.parametrize(
    ("near_m", "ditch"),
    [
        ((1.0, 1.0, 1.0), True),
        ((1.0, 1.2, 1.4), True),
        ((1.0, 1.0 - 0.45 * STRAIGHT_M, 1.0), True),
        ((1.0, 1.0 - 0.55 * STRAIGHT_M, 1.0), False),
        ((1.0, 1.0), False),
    ],
)
def test_holes_on_all_lines_with_a_straight_near_edge_are_a_ditch(near_m: tuple[float, ...], ditch: bool) -> None:
    assert is_ditch([hole(near) for near in near_m], 3) == ditch


def test_bumps_and_fewer_than_three_lines_are_no_ditch() -> None:
    assert not is_ditch([GroundFeature("bump", 1.0, 0.04, 0.05)] * 3, 3)
    assert not is_ditch([hole()] * 2, 2)


def test_a_gap_is_bridged_where_a_line_beside_it_shows_it_too() -> None:
    wide = hole(width_m=2.0 * LIMITS.bridge_gap_m)
    at_limit = hole(width_m=LIMITS.bridge_gap_m)
    assert bridged_lines([(0, at_limit), (1, hole()), (2, wide)], LIMITS) == {0, 1}
    assert bridged_lines([(1, hole()), (2, hole())], LIMITS) == {1, 2}
    assert bridged_lines([(0, hole()), (1, wide), (2, hole())], LIMITS) == set()
    assert bridged_lines([(0, GroundFeature("bump", 1.0, 0.04, 0.005)), (1, hole())], LIMITS) == set()
