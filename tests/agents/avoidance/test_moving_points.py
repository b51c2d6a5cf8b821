"""Points for what moves: where it comes next, for a detour, and how near it comes, for the last brake."""

from __future__ import annotations

from math import acos, cos, hypot, pi, sin

import pytest

from lfa.agents.avoidance.moving_points import (
    ASIDE_SHARE,
    AWAY_M,
    BERTH_POINTS,
    BERTH_S,
    MET_M,
    SHADOW_M_MAX,
    SHADOW_S,
    SHADOW_STEPS,
    before,
    berth,
    shadow,
    standing,
)
from lfa.agents.perception.obstacle_tracker import Feature
from lfa.protocol.geometry import Pose2D

RADIUS_M = 0.25
HERE = Pose2D(1.0, 2.0, pi / 2)
"""A robot that looks along y of `map`: x of `base_link` is y of `map` less 2, its y is 1 less x of `map`."""


def moving(x: float, y: float, vx: float, vy: float) -> list[Feature]:
    return [Feature("moving", x, y, RADIUS_M, vx, vy)]


def test_a_shadow_is_the_front_and_both_sides_of_each_place_to_which_it_comes() -> None:
    points = shadow(moving(3.0, 4.0, 0.1, 0.0), HERE)
    assert len(points) == 3 * SHADOW_STEPS
    for n in range(SHADOW_STEPS):
        x = 3.0 + 0.1 * SHADOW_S * (n + 1) / SHADOW_STEPS
        in_map = [(x, 4.0 - RADIUS_M), (x + RADIUS_M, 4.0), (x, 4.0 + RADIUS_M)]
        assert points[3 * n : 3 * n + 3] == [pytest.approx((y - 2.0, 1.0 - x)) for x, y in in_map]


def test_the_shadow_of_what_moves_across_the_axes_has_its_front_ahead_and_its_sides_beside_it() -> None:
    feature = moving(0.0, 0.0, 0.06, 0.08)
    for n, point in enumerate(shadow(feature, Pose2D())):
        x, y = feature[0].at(SHADOW_S * (n // 3 + 1) / SHADOW_STEPS)
        dx, dy = point[0] - x, point[1] - y
        assert hypot(dx, dy) == pytest.approx(RADIUS_M)
        assert 0.6 * dx + 0.8 * dy == pytest.approx(RADIUS_M if n % 3 == 1 else 0.0)


def test_what_moves_fast_has_no_shadow() -> None:
    slow_mps = SHADOW_M_MAX / SHADOW_S
    assert shadow(moving(3.0, 0.0, 0.0, 1.01 * slow_mps), Pose2D()) == []
    assert shadow(moving(3.0, 0.0, 0.0, 0.99 * slow_mps), Pose2D()) != []


def test_the_brake_sees_the_near_surface_of_what_comes_where_it_will_be_and_a_little_nearer() -> None:
    (point,) = before(moving(1.0, 5.0, 0.0, -0.5), HERE, 1.0, 0.4)
    assert point == pytest.approx((2.5 - RADIUS_M - AWAY_M, 0.0))


def test_the_brake_sees_what_comes_obliquely_in_its_direction() -> None:
    (point,) = before(moving(0.0, 4.0, 0.0, -0.5), HERE, 1.0, 0.4)
    apart = hypot(1.5, 1.0)
    share = 1.0 - (RADIUS_M + AWAY_M) / apart
    assert point == pytest.approx((share * 1.5, share * 1.0))
    share = 1.0 - (RADIUS_M + AWAY_M) / hypot(1.5, 0.8)
    assert before(moving(2.0, 0.8, -0.5, 0.0), Pose2D(), 1.0, 0.4) == [pytest.approx((share * 1.5, share * 0.8))]


@pytest.mark.parametrize(
    ("feature", "v_mps"),
    [
        pytest.param(moving(1.0, 5.0, 0.0, 0.5), 0.4, id="it goes away"),
        pytest.param(moving(1.0, 5.0, 0.0, -0.5), -0.4, id="the robot drives away from it"),
        pytest.param(moving(3.0, 2.5, -0.5, 0.0), 0.4, id="it comes from the side"),
    ],
)
def test_the_brake_leaves_out_what_it_cannot_help(feature: list[Feature], v_mps: float) -> None:
    assert before(feature, HERE, 1.0, v_mps) == []


@pytest.mark.parametrize(
    ("y", "vy"),
    [
        pytest.param(2.9, -0.7, id="it will be beside the robot's centre"),
        pytest.param(2.9, -0.9, id="it will be in it"),
        pytest.param(2.6, -1.5, id="it will have come through it"),
    ],
)
def test_the_brake_sees_what_comes_over_the_robot_where_it_comes_from(y: float, vy: float) -> None:
    (point,) = before(moving(1.0, y, 0.0, vy), HERE, 1.0, 0.4)
    assert point == pytest.approx((MET_M, 0.0))


def test_from_what_comes_over_the_robot_it_may_drive_away() -> None:
    assert before(moving(1.0, 2.9, 0.0, -0.9), HERE, 1.0, -0.4) == []


def test_a_robot_that_backs_brakes_for_what_comes_from_behind() -> None:
    (point,) = before(moving(1.0, -1.0, 0.0, 0.5), HERE, 1.0, -0.4)
    assert point == pytest.approx((-2.5 + RADIUS_M + AWAY_M, 0.0))


@pytest.mark.parametrize(("further_rad", "seen"), [(-0.02, True), (0.02, False)])
def test_the_side_begins_where_little_of_its_way_is_the_robots(further_rad: float, seen: bool) -> None:
    off_rad = acos(ASIDE_SHARE) + further_rad
    x, y = 2.0 * cos(off_rad), 2.0 * sin(off_rad)
    assert bool(before(moving(x + 0.1, y, -0.1, 0.0), Pose2D(), 1.0, 0.4)) == seen


def restless(x: float, y: float, vx: float = 0.0, vy: float = 0.0) -> Feature:
    """Return something that turns again and again."""
    return Feature("moving", x, y, RADIUS_M, vx, vy, keeps_s=1.0)


def test_what_turns_again_and_again_is_given_the_berth_that_it_may_come_in_any_direction() -> None:
    points = berth([restless(3.0, 2.0, 0.3, 0.4)], Pose2D(), 0.15)
    assert len(points) == BERTH_POINTS
    assert [hypot(x - 3.0, y - 2.0) for x, y in points] == [pytest.approx(RADIUS_M + BERTH_S * 0.5)] * BERTH_POINTS


def test_what_keeps_its_course_has_no_berth_and_within_one_no_robot_is_barred() -> None:
    assert berth(moving(3.0, 2.0, 0.3, 0.4), Pose2D(), 0.15) == []
    assert berth([restless(0.5, 0.0, 0.3, 0.4)], Pose2D(), 0.15) == []


def test_a_patient_robot_goes_round_what_turns_again_and_again_and_not_round_what_it_gives_way_to() -> None:
    seen = [(2.0 - RADIUS_M, 0.0), (-2.0 + RADIUS_M, 0.0), (0.0, 1.0)]
    turns, goes_by = restless(2.0, 0.0), moving(-2.0, 0.0, 0.0, 0.1)
    points = standing(seen, [turns, *goes_by], Pose2D(), 0.15, patient=True)
    assert points[:2] == [seen[0], seen[2]]
    assert set(standing(seen, [turns, *goes_by], Pose2D(), 0.15, patient=False)) >= set(seen)
