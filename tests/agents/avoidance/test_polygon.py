"""A robot whose body is a polygon: what it may command, and how it gets through what its circle does not pass."""

from __future__ import annotations

from math import cos, sin

import pytest

from lfa.agents.avoidance.arc_planner import BACK_MPS, ArcPlanner
from lfa.agents.avoidance.safety import safe
from lfa.agents.perception.footprint import PolygonBody
from lfa.agents.perception.scan import Point
from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc, in_base
from lfa.protocol.mission import Limits

LIMITS, DT, RADIUS_M = Limits(), 0.02, 0.333
BODY = PolygonBody(((0.254, 0.215), (-0.254, 0.215), (-0.254, -0.215), (0.254, -0.215)))
CORRIDOR = [(0.02 * n, side * 0.265) for n in range(-100, 150) for side in (1.0, -1.0)]


def seen_from(pose: Pose2D, points: list[Point]) -> list[Point]:
    return [in_base(pose, point) for point in points]


def out_of_it_m(points: list[Point]) -> float:
    return min(max(abs(x) - 0.254, abs(y) - 0.215) for x, y in points)


def driven(wanted: Twist, points: list[Point], steps: int = 200) -> tuple[Pose2D, float]:
    """Return where a robot that wants this twist all the time comes to, and the least distance [m] to a point."""
    pose, last, least_m = Pose2D(), STILL, 9.0
    for _ in range(steps):
        last = safe(wanted, last, seen_from(pose, points), RADIUS_M, LIMITS, DT, BODY)
        pose = along_arc(pose, last, DT)
        least_m = min(least_m, out_of_it_m(seen_from(pose, points)))
    return pose, least_m


def test_a_polygon_drives_straight_through_a_passage_that_its_circle_does_not_pass() -> None:
    pose, _ = driven(Twist(0.4, 0.0), CORRIDOR)
    assert pose.x > 1.3
    round_one = safe(Twist(0.4, 0.0), Twist(0.4, 0.0), CORRIDOR, RADIUS_M, LIMITS, DT)
    assert round_one.linear_x < 0.4


def test_a_polygon_turns_in_a_narrow_passage_only_until_a_corner_comes_near() -> None:
    pose, least_m = driven(Twist(0.0, 1.0), CORRIDOR)
    assert 0.0 < pose.theta < 0.2
    assert least_m > 0.0


def test_a_bend_that_the_drive_reaches_late_does_not_lead_a_corner_into_a_wall() -> None:
    aslant = Pose2D(0.0, 0.0, -0.311)
    c, s = cos(aslant.theta), sin(aslant.theta)
    wall = [(c * 0.47 + s * y, -s * 0.47 + c * y) for y in (0.005 * n for n in range(20, 200))]
    pose, last, least_m = Pose2D(), Twist(0.4, 0.0), 9.0
    for _ in range(100):
        last = safe(Twist(0.5, 1.5), last, seen_from(pose, wall), RADIUS_M, LIMITS, DT, BODY)
        pose = along_arc(pose, last, DT)
        least_m = min(least_m, out_of_it_m(seen_from(pose, wall)))
    assert least_m > 0.0


@pytest.mark.parametrize("wanted", [Twist(1e-170, 0.0), Twist(0.0, -1e-170), Twist(5e-324, 0.3), STILL])
def test_a_command_that_fades_out_is_made_safe_as_any_other(wanted: Twist) -> None:
    limited = safe(wanted, STILL, CORRIDOR, RADIUS_M, LIMITS, DT, BODY)
    assert abs(limited.linear_x) <= abs(wanted.linear_x)
    assert abs(limited.angular_z) <= abs(wanted.angular_z)


def along_x(s: float) -> Point:
    return s, 0.0


def test_arcs_lead_a_polygon_on_between_walls_hardly_wider_than_itself() -> None:
    twist = ArcPlanner(RADIUS_M, LIMITS, BODY).steer(CORRIDOR, along_x, Twist(0.4, 0.0), 1.0)
    assert twist.linear_x > 0.1
    blocked = ArcPlanner(RADIUS_M, LIMITS)
    blocked.steer(CORRIDOR, along_x, Twist(0.4, 0.0), 1.0)
    assert blocked.blocked


def test_where_a_polygon_cannot_turn_on_the_spot_it_backs_off() -> None:
    planner = ArcPlanner(RADIUS_M, LIMITS, BODY)
    tight = [(x, y * 0.9) for x, y in CORRIDOR]
    twist = planner.steer(tight, lambda s: (0.0, s), Twist(0.0, 0.8), 1.0)
    assert planner.blocked
    assert twist == Twist(-BACK_MPS, 0.0)
