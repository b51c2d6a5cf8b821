"""A body that is a polygon drives and turns as far as what it sweeps is free, its corners included."""

from math import cos, hypot, inf, pi, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from lfa.agents.perception.footprint import PolygonBody
from lfa.protocol.geometry import Pose2D, Twist, along_arc, in_base
from lfa.protocol.mission import Mission

JACKAL = ((0.254, 0.215), (-0.254, 0.215), (-0.254, -0.215), (0.254, -0.215))
BODY = PolygonBody(JACKAL)
MARGIN_M, STEP_M = 0.02, 0.002
MANY = tuple((0.3 * cos(n * pi / 16), 0.25 * sin(n * pi / 16)) for n in range(32))
POLYGONS = {"rectangle": JACKAL, "triangle": ((0.4, 0.0), (-0.2, 0.25), (-0.2, -0.25)), "32 corners": MANY}
CORRIDOR = [(0.02 * n, side * 0.265) for n in range(-100, 100) for side in (1.0, -1.0)]
"""Walls 5 cm beside the body: narrower than its circle, so that it cannot turn there."""
arcs = st.builds(Twist, st.sampled_from((1.0, -1.0)), st.floats(-6.0, 6.0))
points_around = st.lists(st.tuples(st.floats(-1.2, 1.2), st.floats(-1.2, 1.2)), max_size=12)
polygons = st.sampled_from(sorted(POLYGONS)).map(lambda name: PolygonBody(POLYGONS[name]))


def out_of_it_m(x: float, y: float) -> float:
    """Return how far a point in `base_link` is beyond the sides; negative inside of all."""
    return max(abs(x) - 0.254, abs(y) - 0.215)


@given(st.floats(-1.2, 1.2), st.floats(-1.2, 1.2), arcs)
def test_a_body_that_drives_as_far_as_is_free_comes_to_the_margin_and_not_into_it(
    x: float, y: float, arc: Twist
) -> None:
    if out_of_it_m(x, y) <= MARGIN_M + 1e-3:
        return
    free_m = BODY.free_along([(x, y)], arc, MARGIN_M, 1.5)
    at = 0.0
    while at < free_m - 1e-6:
        seen = in_base(along_arc(Pose2D(), arc, at), (x, y))
        assert out_of_it_m(*seen) >= MARGIN_M - 1e-6
        at += STEP_M
    if free_m < 1.5:
        beyond = in_base(along_arc(Pose2D(), arc, free_m + 1e-4), (x, y))
        assert out_of_it_m(*beyond) <= MARGIN_M + 1e-3


@given(st.floats(0.22, 0.6), st.floats(-pi, pi), st.sampled_from((1.0, -1.0)))
def test_a_turn_on_the_spot_ends_where_a_corner_comes_to_the_margin(far_m: float, angle: float, sign: float) -> None:
    x, y = far_m * cos(angle), far_m * sin(angle)
    if out_of_it_m(x, y) <= MARGIN_M + 1e-3:
        return
    free_rad = BODY.free_turn([(x, y)], sign, MARGIN_M, pi)
    turned = 0.0
    while turned < free_rad - 1e-6:
        assert out_of_it_m(*in_base(Pose2D(0.0, 0.0, sign * turned), (x, y))) >= MARGIN_M - 1e-6
        turned += 0.01
    if free_rad < pi:
        assert out_of_it_m(*in_base(Pose2D(0.0, 0.0, sign * (free_rad + 1e-4)), (x, y))) <= MARGIN_M + 1e-3


@given(polygons, points_around, arcs, st.sampled_from((0.9, inf)))
def test_the_way_among_many_points_ends_at_the_first_one_that_is_met(
    body: PolygonBody, points: list[tuple[float, float]], arc: Twist, within_m: float
) -> None:
    """Points outside of the margin: what is inside changes the margin for all."""
    outside = [point for point in points if not body.inside([point], MARGIN_M)]
    each = [body.free_along([point], arc, MARGIN_M, within_m) for point in outside]
    assert body.free_along(outside, arc, MARGIN_M, within_m) == min(each, default=within_m)


@given(polygons, st.lists(st.tuples(st.floats(-0.1, 0.7), st.floats(-0.4, 0.4)), max_size=30), st.floats(-6.0, 6.0))
def test_points_that_are_not_beside_an_arc_end_no_way_on_it(
    body: PolygonBody, points: list[tuple[float, float]], curvature: float
) -> None:
    outside = [point for point in points if not body.inside([point], MARGIN_M)]
    beside = body.beside([(x * x + y * y, x, y) for x, y in outside], curvature, MARGIN_M)
    arc = Twist(1.0, curvature)
    assert body.free_along(beside, arc, MARGIN_M, 0.9) == body.free_along(outside, arc, MARGIN_M, 0.9)


@given(st.sampled_from(sorted(POLYGONS)), points_around, st.sampled_from((0.02, 0.12)))
def test_a_point_is_inside_by_the_side_that_it_is_farthest_beyond(
    name: str, points: list[tuple[float, float]], margin_m: float
) -> None:
    corners, found = POLYGONS[name], PolygonBody(POLYGONS[name]).inside(points, margin_m)
    for apart_m, nx, ny, x, y in found:
        beyond = [
            ((by - ay) * (x - ax) - (bx - ax) * (y - ay)) / hypot(bx - ax, by - ay)
            for (ax, ay), (bx, by) in zip(corners, (*corners[1:], corners[0]), strict=True)
        ]
        assert apart_m == pytest.approx(max(beyond), abs=1e-9)
        assert hypot(nx, ny) == pytest.approx(1.0)


def test_a_passage_narrower_than_its_circle_is_free_straight_along_and_not_for_a_turn() -> None:
    assert BODY.reach_m > 0.265
    assert BODY.free_along(CORRIDOR, Twist(1.0, 0.0), MARGIN_M, 1.5) == 1.5
    assert BODY.free_along(CORRIDOR, Twist(-1.0, 0.0), MARGIN_M, 1.5) == 1.5
    assert BODY.free_turn(CORRIDOR, 1.0, MARGIN_M, pi) < 0.2
    assert BODY.free_along(CORRIDOR, Twist(1.0, 1.0), MARGIN_M, 1.5) < 0.4


def test_the_rear_corner_that_a_bend_swings_out_bars_it() -> None:
    beside_the_rear = [(-0.25, -0.24)]
    assert BODY.free_along(beside_the_rear, Twist(1.0, 3.0), MARGIN_M, 1.0) < 0.05
    assert BODY.free_along(beside_the_rear, Twist(1.0, -3.0), MARGIN_M, 1.0) > 0.05


def test_a_wall_inside_the_margin_along_which_the_body_drives_does_not_stop_it() -> None:
    wall = [(0.02 * n, 0.225) for n in range(-50, 50)]
    assert BODY.free_along(wall, Twist(1.0, 0.0), MARGIN_M, 1.0) == 1.0
    assert BODY.free_along(wall, Twist(1.0, 1.0), MARGIN_M, 1.0) == 0.0
    assert BODY.free_along([*wall, (0.6, 0.0)], Twist(1.0, 0.0), MARGIN_M, 1.0) == pytest.approx(0.6 - 0.254, abs=0.02)


def test_a_point_inside_the_margin_bars_what_comes_nearer_to_it_and_frees_what_leads_away() -> None:
    before_the_nose = [(0.264, 0.0)]
    assert BODY.free_along(before_the_nose, Twist(0.5, 0.0), MARGIN_M) == 0.0
    assert BODY.free_along(before_the_nose, Twist(-0.5, 0.0), MARGIN_M) == inf


@pytest.mark.parametrize("odd", [(-0.2, 0.0), (0.0, 0.15), (0.1, -0.14)])
def test_a_reading_deep_inside_the_body_lets_it_come_no_nearer_to_a_wall(odd: tuple[float, float]) -> None:
    wall = [(0.6, 0.02 * n) for n in range(-20, 21)]
    assert BODY.free_along([*wall, odd], Twist(0.3, 0.0), MARGIN_M) == pytest.approx(0.6 - 0.254 - MARGIN_M)


@pytest.mark.parametrize("corners", [(), JACKAL[:2], tuple(reversed(JACKAL)), tuple((x + 1.0, y) for x, y in JACKAL)])
def test_what_is_no_polygon_around_base_link_is_no_footprint(corners: tuple[tuple[float, float], ...]) -> None:
    assert PolygonBody.of(replace(Mission(), footprint_m=corners)) is None


def test_a_missions_polygon_is_the_footprint_of_its_robots() -> None:
    footprint = PolygonBody.of(replace(Mission(), footprint_m=JACKAL))
    assert footprint is not None
    assert footprint.reach_m == hypot(*JACKAL[0])
