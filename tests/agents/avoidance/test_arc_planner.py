"""The local planner: through what the body passes, along the route, never into what the scan shows."""

from __future__ import annotations

from math import cos, hypot, pi, sin, sqrt

import pytest

from lfa.agents.avoidance.arc_planner import ArcPlanner
from lfa.agents.perception.scan import Point
from lfa.protocol.geometry import Pose2D, Twist, along_arc, in_base
from lfa.protocol.mission import Limits

RADIUS_M, DT = 0.25, 0.05
WANTED = Twist(0.5, 0.0)
TURN_RADPS = 1.0


def route_along_x(pose: Pose2D) -> object:
    """Return the route y = 0 from the place beside `pose`, in `base_link`."""
    return lambda s: in_base(pose, (pose.x + s, 0.0))


def pursuit(pose: Pose2D) -> Twist:
    x, y = in_base(pose, (pose.x + 0.4, 0.0))
    return Twist(0.5, 0.5 * 2.0 * y / (x * x + y * y))


def drive(posts: list[Point], pose: Pose2D, seconds: float) -> tuple[Pose2D, float]:
    """Drive along y = 0 among posts; return the last pose and the least clearance [m] of the body."""
    planner, least = ArcPlanner(RADIUS_M, Limits()), 9.0
    for _ in range(round(seconds / DT)):
        points = [in_base(pose, post) for post in posts]
        twist = planner.steer(points, route_along_x(pose), pursuit(pose), TURN_RADPS)  # type: ignore[arg-type]
        pose = along_arc(pose, twist, DT)
        least = min([least, *(hypot(x - pose.x, y - pose.y) - RADIUS_M for x, y in posts)])
    return pose, least


def test_the_wanted_twist_stays_where_there_is_room() -> None:
    planner = ArcPlanner(RADIUS_M, Limits())
    assert planner.steer([(2.0, 0.0), (0.5, 0.6)], route_along_x(Pose2D()), WANTED, TURN_RADPS) == WANTED  # type: ignore[arg-type]


@pytest.mark.parametrize("off_m", [0.0, 0.03, -0.05, 0.08])
def test_a_gap_five_centimetres_wider_than_the_body_on_either_side_is_passed(off_m: float) -> None:
    """The route leads through the gap off its middle, as a route of cells does."""
    half_m = RADIUS_M + 0.05
    wall = [n * 0.05 for n in range(20)]
    posts = [(2.0, off_m + side * (half_m + y)) for y in wall for side in (1.0, -1.0)]
    pose, least = drive(posts, Pose2D(), 14.0)
    assert pose.x > 2.5
    assert least > 0.0


def test_before_a_gap_that_is_too_narrow_the_robot_says_that_it_is_blocked() -> None:
    wall = [(0.5, 0.1 * n) for n in range(-20, 21)]
    planner, pose = ArcPlanner(RADIUS_M, Limits()), Pose2D(0.2, 0.0, 0.0)
    points = [in_base(pose, post) for post in wall]
    twist = planner.steer(points, route_along_x(pose), WANTED, TURN_RADPS)  # type: ignore[arg-type]
    assert planner.blocked
    assert twist.linear_x <= 0.0


def test_facing_a_wall_it_turns_on_the_spot_towards_its_route() -> None:
    wall = [(RADIUS_M + 0.03, 0.05 * n) for n in range(-20, 21)]
    aside = lambda s: (s * cos(0.5 * pi), s * sin(0.5 * pi))  # noqa: E731
    twist = ArcPlanner(RADIUS_M, Limits()).steer(wall, aside, WANTED, TURN_RADPS)
    assert twist == Twist(0.0, TURN_RADPS)


@pytest.mark.parametrize("a_max_mps2", [1.0, 4.0])
def test_beside_what_is_close_a_robot_drives_as_fast_as_its_drive_can_brake(a_max_mps2: float) -> None:
    limits = Limits(v_max_mps=2.0, a_max_mps2=a_max_mps2)
    posts = [(0.1, side * (RADIUS_M + 0.06)) for side in (1.0, -1.0)]
    twist = ArcPlanner(RADIUS_M, limits).steer(posts, route_along_x(Pose2D()), Twist(2.0, 0.0), TURN_RADPS)  # type: ignore[arg-type]
    stops_within_room = sqrt(2.0 * 0.8 * a_max_mps2 * 0.12)
    assert stops_within_room <= twist.linear_x <= 1.2 * stops_within_room


def test_an_arc_straighter_than_the_wanted_one_is_driven_as_fast_as_its_own_bend_allows() -> None:
    """The wanted bend was slowed for how much it bends, and is not free: the speed that is told for the arc counts."""
    limits, slow_bend = Limits(v_max_mps=2.0, a_max_mps2=4.0), Twist(0.5, 2.1)
    posts = [(0.3, RADIUS_M + 0.3)]
    route = route_along_x(Pose2D())
    twist = ArcPlanner(RADIUS_M, limits).steer(posts, route, slow_bend, TURN_RADPS, lambda c: 1.0 / (1.0 + abs(c)))  # type: ignore[arg-type]
    curvature = twist.angular_z / twist.linear_x
    assert abs(curvature) < 2.1 / 0.5
    assert twist.linear_x == pytest.approx(max(0.5, 1.0 / (1.0 + abs(curvature))))
    assert twist.linear_x > 0.5


def test_a_robot_that_touches_a_wall_beside_it_turns_away_and_drives_off() -> None:
    """Readings of the wall before and behind it bar both ways along the wall."""
    wall = [(0.02 * n, RADIUS_M + 0.002 * (n % 2)) for n in range(-40, 41)]
    pose, least = drive(wall, Pose2D(), 12.0)
    assert pose.x > 1.5
    assert least > -0.001
