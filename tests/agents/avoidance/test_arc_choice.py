"""The choice among arcs: what each costs, which points bar it, and what the robot does where none is left."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot, pi, sqrt

import pytest

from lfa.agents.avoidance.arc_planner import (
    BACK_MPS,
    HEADING_M,
    ROOM_M,
    ArcPlanner,
    _beside,
    _leads_away,
    _off,
)
from lfa.agents.perception.scan import Point
from lfa.protocol.geometry import Pose2D, Twist, along_arc
from lfa.protocol.mission import Limits

RADIUS_M, TURN_RADPS = 0.25, 1.0
WANTED = Twist(0.5, 0.0)
WALL = [(RADIUS_M + 0.03, 0.05 * n) for n in range(-20, 21)]
LATELY_BARRED, HARDLY_BARRED = (0.3, 0.36), (0.4, 0.36)
"""A point for which a bend to the right is better than the straight way, and one for which it is a little worse."""


def arc(curvature: float) -> Callable[[float], Point]:
    """Return the route that is an arc itself."""

    def route(s: float) -> Point:
        pose = along_arc(Pose2D(), Twist(1.0, curvature), s)
        return pose.x, pose.y

    return route


def chosen(points: list[Point], route: Callable[[float], Point], wanted: Twist = WANTED) -> float:
    """Return the curvature that a planner without a past takes."""
    twist = ArcPlanner(RADIUS_M, Limits()).steer(points, route, wanted, TURN_RADPS)
    return twist.angular_z / twist.linear_x


@pytest.mark.parametrize("curvature", [0.0, 1.4, -2.2])
@pytest.mark.parametrize("length_m", [0.4, 0.9])
def test_an_arc_that_is_the_route_is_off_it_by_half_the_turn_of_the_next_20_cm(
    curvature: float, length_m: float
) -> None:
    assert _off(arc(curvature), curvature, length_m) == pytest.approx(HEADING_M * 0.1 * abs(curvature))


@pytest.mark.parametrize("aside_m", [0.2, -0.3])
@pytest.mark.parametrize("curvature", [0.0, 0.8, -0.8])
def test_an_arc_is_off_a_straight_route_by_its_ends_distance_and_its_turn(aside_m: float, curvature: float) -> None:
    end = along_arc(Pose2D(), Twist(1.0, curvature), 0.7)
    distance_m = hypot(end.x - 0.7, end.y - aside_m)
    assert _off(lambda s: (s, aside_m), curvature, 0.7) == pytest.approx(distance_m + HEADING_M * abs(end.theta))


@pytest.mark.parametrize("end", [(0.5, 0.2), (0.2, -0.5)])
def test_where_the_route_has_ended_only_the_distance_counts(end: Point) -> None:
    at = along_arc(Pose2D(), Twist(1.0, 1.4), 0.9)
    assert _off(lambda _s: end, 1.4, 0.9) == pytest.approx(hypot(at.x - end[0], at.y - end[1]))


@pytest.mark.parametrize(
    ("curvature", "length_m", "away"),
    [(0.0, 0.9, True), (1.7, 0.9, True), (-1.7, 0.9, True), (2.2, 0.9, False), (9.0, 0.9, False), (9.0, 0.06, False)],
)
def test_an_arc_leads_away_that_turns_less_than_a_quarter_about_a_centre_beside_the_body(
    curvature: float, length_m: float, away: bool
) -> None:
    assert _leads_away(curvature, length_m, RADIUS_M + ROOM_M) is away


@pytest.mark.parametrize("curvature", [0.0, 0.35, -0.8, 2.2, -5.5])
@pytest.mark.parametrize(("aside_m", "kept"), [(0.0, True), (0.37, True), (0.3701, False), (0.9, False), (2.5, False)])
def test_the_points_beside_an_arc_are_those_nearer_than_the_width(curvature: float, aside_m: float, kept: bool) -> None:
    """A point at the width itself stays, whatever the rounding."""
    on_it, points = along_arc(Pose2D(), Twist(1.0, curvature), 0.2), []
    for side in (1.0, -1.0):
        beyond = abs(curvature) * aside_m > 1.0 and side * curvature > 0.0  # past the centre it comes near again
        if not beyond:
            at = along_arc(Pose2D(on_it.x, on_it.y, on_it.theta + side * pi / 2), Twist(1.0, 0.0), aside_m)
            points.append((at.x * at.x + at.y * at.y, at.x, at.y))
    assert _beside(points, curvature, RADIUS_M + ROOM_M) == ([(x, y) for _, x, y in points] if kept else [])


def test_a_wanted_bend_between_the_compared_ones_is_taken_where_it_fits_best() -> None:
    """A point takes its room, and not what it needs."""
    beside = along_arc(Pose2D(), Twist(1.0, 1.2), 0.5)
    edge = along_arc(Pose2D(beside.x, beside.y, beside.theta + pi / 2), Twist(1.0, 0.0), RADIUS_M + ROOM_M - 0.01)
    assert chosen([(edge.x, edge.y)], arc(1.2), Twist(0.5, 0.6)) == pytest.approx(1.2)


@pytest.mark.parametrize("curvature", [0.35, -0.35, 0.8, -0.8])
def test_of_the_compared_bends_the_one_that_follows_the_route_is_taken(curvature: float) -> None:
    outside = (0.3, -0.34 if curvature > 0.0 else 0.34)
    assert chosen([outside], arc(curvature)) == pytest.approx(curvature)


def test_more_clearance_is_worth_a_way_a_little_off_the_route() -> None:
    assert chosen([LATELY_BARRED], arc(0.0)) == pytest.approx(-0.35)
    assert chosen([HARDLY_BARRED], arc(0.0)) == 0.0


def test_an_arc_is_kept_for_which_another_is_hardly_better() -> None:
    planner = ArcPlanner(RADIUS_M, Limits())
    planner.steer([LATELY_BARRED], arc(0.0), WANTED, TURN_RADPS)
    twist = planner.steer([HARDLY_BARRED], arc(0.0), WANTED, TURN_RADPS)
    assert twist.angular_z / twist.linear_x == pytest.approx(-0.35)


def test_once_the_wanted_arc_was_free_no_earlier_one_is_kept() -> None:
    planner = ArcPlanner(RADIUS_M, Limits())
    planner.steer([LATELY_BARRED], arc(0.0), WANTED, TURN_RADPS)
    planner.steer([], arc(0.0), WANTED, TURN_RADPS)
    assert planner.steer([HARDLY_BARRED], arc(0.0), WANTED, TURN_RADPS).angular_z == 0.0


def test_what_lies_behind_the_end_of_the_route_slows_nothing() -> None:
    fast = Twist(1.5, 0.0)
    post = (0.3 + RADIUS_M + ROOM_M + 0.02, 0.0)
    planner = ArcPlanner(RADIUS_M, Limits(v_max_mps=2.0))
    assert planner.steer([post], lambda s: (min(s, 0.3), 0.0), fast, TURN_RADPS) == fast


@pytest.mark.parametrize("far_m", [1.0, 1.1, 1.2])
def test_whatever_is_nearer_to_the_arc_than_its_room_slows_the_drive(far_m: float) -> None:
    """The farthest such point lies a body's radius and its room beyond the arc's 0.9 m."""
    planner = ArcPlanner(RADIUS_M, Limits(v_max_mps=2.0, a_max_mps2=1.0))
    twist = planner.steer([(far_m, 0.0)], arc(0.0), Twist(2.0, 0.0), TURN_RADPS)
    assert twist == Twist(pytest.approx(sqrt(2.0 * 0.8 * (far_m - RADIUS_M))), 0.0)


@pytest.mark.parametrize("behind", [[], [(-1.0, 0.0)], [(-0.4, 0.29)]])
def test_a_robot_that_faces_a_wall_along_its_route_backs_off(behind: list[Point]) -> None:
    planner = ArcPlanner(RADIUS_M, Limits())
    assert planner.steer([*WALL, *behind], arc(0.0), WANTED, TURN_RADPS) == Twist(-BACK_MPS, 0.0)
    assert planner.blocked


@pytest.mark.parametrize("behind", [(-0.3, 0.0), (-0.1, 0.26)])
def test_a_robot_with_something_close_behind_it_stands_at_the_wall(behind: Point) -> None:
    planner = ArcPlanner(RADIUS_M, Limits())
    assert planner.steer([*WALL, behind], arc(0.0), WANTED, TURN_RADPS) == Twist(0.0, 0.0)
    assert planner.blocked


def test_where_to_turn_the_route_tells_a_body_and_its_room_ahead() -> None:
    """It leads on along the robot for 0.2 m, and then to the left."""
    planner = ArcPlanner(RADIUS_M, Limits())
    corner = lambda s: (min(s, 0.2), max(0.0, s - 0.2))  # noqa: E731
    assert planner.steer(WALL, corner, WANTED, TURN_RADPS) == Twist(0.0, TURN_RADPS)
    assert not planner.blocked


def test_a_new_planner_is_not_blocked() -> None:
    assert not ArcPlanner(RADIUS_M, Limits()).blocked


@pytest.mark.parametrize("wanted", [WANTED, Twist(0.0, 1.0), Twist(-0.2, 0.0)])
def test_blocked_ends_as_soon_as_the_wanted_twist_is_free(wanted: Twist) -> None:
    planner = ArcPlanner(RADIUS_M, Limits())
    planner.steer(WALL, arc(0.0), WANTED, TURN_RADPS)
    assert planner.steer([], arc(0.0), wanted, TURN_RADPS) == wanted
    assert not planner.blocked
