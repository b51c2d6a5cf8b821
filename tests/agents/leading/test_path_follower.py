"""How a leader drives: progress on the route, rest at the goal, and bends that the whole chain can keep up with."""

from math import atan2, cos, hypot, pi, sin

import pytest

from lfa.agents.formation.formation import slots_of
from lfa.agents.leading.path_follower import PathFollower
from lfa.agents.leading.route import CORNER_RADIUS_M, Route
from lfa.agents.leading.timed_route import Timetable
from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc
from lfa.protocol.messages.team import RouteProgress
from lfa.protocol.mission import FormationSpec, Leading, Limits

LIMITS = Limits()
DT = 0.02
CORNERED = ((0.0, 0.0), (8.0, 0.0), (8.0, 8.0))


def driven(
    leading: Leading, start: Pose2D, slots: tuple = (), seconds: float = 80.0, team: RouteProgress | None = None
) -> list[tuple[Pose2D, Twist]]:
    lead, pose, twist = PathFollower(leading, LIMITS), start, STILL
    lead.begin(pose, team)
    course = []
    for _ in range(round(seconds / DT)):
        wanted = lead.step(pose, twist, slots, leading.cruise_mps)
        v = max(twist.linear_x - DT, min(twist.linear_x + DT, wanted.linear_x))
        twist = Twist(v, wanted.angular_z)
        pose = along_arc(pose, twist, DT)
        course.append((pose, twist))
    return course


@pytest.mark.parametrize("motion", ["path_following", "point_to_point"])
def test_a_leader_comes_to_rest_at_the_goal(motion: str) -> None:
    course = driven(Leading(motion=motion, route_m=CORNERED), Pose2D())  # type: ignore[arg-type]
    pose, twist = course[-1]
    assert hypot(pose.x - 8.0, pose.y - 8.0) <= 0.10
    assert abs(twist.linear_x) < 1e-3
    assert abs(twist.angular_z) < 1e-3


def test_path_following_keeps_to_the_route_rounded_by_the_missions_radius() -> None:
    route = Route(CORNERED)
    for pose, _ in driven(Leading(route_m=CORNERED, corner_radius_m=CORNER_RADIUS_M), Pose2D()):
        x, y = route.point(route.nearest(pose.x, pose.y))
        assert hypot(pose.x - x, pose.y - y) < 0.08


def test_point_to_point_goes_straight() -> None:
    course = driven(Leading(motion="point_to_point", route_m=((8.0, 8.0),)), Pose2D(0.0, 0.0, pi / 4))
    assert max(abs(pose.x - pose.y) for pose, _ in course) < 0.05


def test_a_new_leader_beside_the_route_joins_it_ahead_and_never_turns_back() -> None:
    course = driven(Leading(route_m=((0.0, 0.0), (12.0, 0.0))), Pose2D(4.0, 1.0, 0.0), team=RouteProgress(1, 7.0))
    assert min(pose.x for pose, _ in course) >= 4.0 - 1e-6
    assert abs(course[-1][0].y) < 0.10


def test_corners_are_rounded_to_the_radius() -> None:
    route = Route(CORNERED)
    assert max(abs(k) for k in route.curvature) == pytest.approx(1.0 / CORNER_RADIUS_M, rel=0.1)
    assert route.length_m < 16.0


def test_in_a_bend_the_leader_slows_for_the_outermost_follower() -> None:
    """control.md 2.2: f v <= 0.8 v_max, here for three in left echelon in a right bend."""
    route = ((0.0, 0.0), (8.0, 0.0), (8.0, -8.0))
    slots = slots_of(FormationSpec(), (2, 3, 4))
    leading = Leading(route_m=route, corner_radius_m=CORNER_RADIUS_M)
    alone = driven(leading, Pose2D())
    team = driven(leading, Pose2D(), slots)
    fastest_in_bend = max(t.linear_x for p, t in team if p.x > 7.0 and -1.0 < p.y < -0.5)
    assert max(t.linear_x for p, t in alone if p.x > 7.0 and -1.0 < p.y < -0.5) == pytest.approx(0.5, abs=0.01)
    assert fastest_in_bend < 0.4


def test_reactive_goes_for_the_goal_from_wherever_it_is() -> None:
    lead, pose = PathFollower(Leading(motion="reactive", route_m=((8.0, 8.0),)), LIMITS), Pose2D(3.0, 2.0, 0.0)
    lead.begin(pose)
    assert lead.route is None
    x, y = lead.ahead(pose, 1.0)
    assert hypot(x, y) == pytest.approx(1.0)
    assert atan2(y, x) == pytest.approx(atan2(6.0, 5.0))
    assert lead.progress_m == 0.0
    lead.track(Pose2D(8.0, 7.0, 0.0))
    assert lead.progress_m == pytest.approx(hypot(5.0, 6.0) - 1.0)


TIMED = Leading(motion="trajectory", route_m=((0.0, 0.0), (2.0, 0.0), (8.0, 0.0)), times_s=(0.0, 8.0, 20.0))


def timed(pause: tuple[float, float] = (99.0, 99.0)) -> dict[float, tuple[float, float]]:
    """Of each half second: how far the leader has come, and how far it should be; it is held up during `pause`."""
    lead, table, pose, twist = PathFollower(TIMED, LIMITS), Timetable(TIMED), Pose2D(), STILL
    lead.begin(pose)
    table.begin(lead.waypoints_m, lead.place_m, 0.0)
    course = {}
    for n in range(round(24.0 / DT)):
        now = n * DT
        course[now] = (pose.x, table.due_m(now))
        wanted = lead.step(pose, twist, (), table.speed(lead.place_m, now))
        v = 0.0 if pause[0] <= now < pause[1] else max(twist.linear_x - DT, min(twist.linear_x + DT, wanted.linear_x))
        twist = Twist(v, wanted.angular_z)
        pose = along_arc(pose, twist, DT)
    return course


def test_a_trajectory_is_kept_to_by_the_clock() -> None:
    course = timed()
    late = [due - x for now, (x, due) in course.items() if 3.0 < now < 18.0]
    assert max(map(abs, late)) < 0.3
    assert course[20.0][0] == pytest.approx(8.0, abs=0.3)


def test_a_delay_on_a_trajectory_is_made_up_for() -> None:
    course = timed(pause=(2.0, 5.0))
    assert course[5.0][1] - course[5.0][0] > 0.5
    assert course[18.0][1] - course[18.0][0] < 0.3


def test_a_new_leader_takes_the_trajectory_up_where_it_stands() -> None:
    lead, table = PathFollower(TIMED, LIMITS), Timetable(TIMED)
    lead.begin(Pose2D(2.0, 0.3, 0.0), RouteProgress(2, 5.5))
    table.begin(lead.waypoints_m, lead.place_m, 500.0)
    assert table.due_m(500.0) == pytest.approx(2.0, abs=0.01)
    assert table.due_m(506.0) == pytest.approx(5.0, abs=0.01)


def test_a_route_of_one_point_begins_where_the_robot_stands() -> None:
    pose, twist = driven(Leading(route_m=((3.0, 1.0),)), Pose2D())[-1]
    assert hypot(pose.x - 3.0, pose.y - 1.0) <= 0.10
    assert twist.linear_x < 1e-3


ROUND = (*((round(4.0 * sin(0.1 * n), 3), round(4.0 - 4.0 * cos(0.1 * n), 3)) for n in range(63)), (0.0, 0.0))


@pytest.mark.parametrize("motion", ["path_following", "point_to_point"])
def test_a_round_that_ends_where_it_began_is_driven_from_its_start_to_its_end(motion: str) -> None:
    leading = Leading(motion=motion, route_m=ROUND)  # type: ignore[arg-type]
    course = driven(leading, Pose2D())
    assert max(hypot(pose.x, pose.y) for pose, _ in course) == pytest.approx(8.0, abs=0.2)
    assert max(twist.linear_x for _, twist in course[:150]) > 0.4
    pose, twist = course[-1]
    assert hypot(pose.x, pose.y) <= 0.10
    assert abs(twist.linear_x) < 1e-3


def test_a_goal_that_the_route_passes_on_the_way_does_not_slow_the_leader() -> None:
    leading = Leading(route_m=((0.0, 0.0), (4.0, 0.0), (8.0, 0.0), (8.0, 4.0), (4.0, 4.0), (4.0, 0.0)))
    course = driven(leading, Pose2D())
    assert min(twist.linear_x for pose, twist in course if 3.0 < pose.x < 5.0 and abs(pose.theta) < 0.3) > 0.3


def test_corners_are_passed_within_the_tolerance() -> None:
    for corner in (
        ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0)),
        ((0.0, 0.0), (4.0, 0.0), (8.0, 2.5)),
        ((4.0, 0.0), (0.0, 0.0)),
    ):
        course = driven(Leading(route_m=corner), Pose2D())
        missed = [min(hypot(pose.x - x, pose.y - y) for pose, _ in course) for x, y in corner]
        assert max(missed) <= 0.15, f"{corner} is missed by {missed}"


def test_a_route_of_kilometres_is_laid_within_a_step_and_bends_as_a_short_one_does() -> None:
    """`lfa go 9999 9999` kept each robot from its step for so long that the leader's lease ran out."""
    short, long = Route(((0.0, 0.0), (8.0, 0.0), (8.0, 8.0))), Route(((-9999.0, 0.0), (8.0, 0.0), (8.0, 9999.0)))
    assert len(long.points) < 1.1 * long.length_m
    corner_s, corner_l = short.nearest(8.0, 0.0), long.nearest(8.0, 0.0)
    for ahead_m in (-2.0, -0.5, 0.0, 0.5, 2.0):
        (x, y), (far_x, far_y) = short.point(corner_s + ahead_m), long.point(corner_l + ahead_m)
        assert hypot(x - far_x, y - far_y) < 0.01
    assert max(long.curvature) == pytest.approx(max(short.curvature), rel=0.02)


@pytest.mark.parametrize(("slots_swing", "least_radps", "most_radps"), [(True, 0.1, 0.3), (False, 1.0, 2.0)])
def test_a_leader_turns_on_the_spot_slowly_only_where_its_turn_swings_its_slots(
    slots_swing: bool, least_radps: float, most_radps: float
) -> None:
    lead = PathFollower(Leading(route_m=((0.0, 0.0), (8.0, 0.0))), LIMITS, slots_swing=slots_swing)
    lead.begin(Pose2D(0.0, 0.0, 2.5))
    wanted = lead.step(Pose2D(0.0, 0.0, 2.5), STILL, slots_of(FormationSpec(), [2, 3]), 0.4)
    assert wanted.linear_x == 0.0
    assert least_radps <= abs(wanted.angular_z) <= most_radps
