"""Backing out of a trap the way that the robot came."""

from math import cos, hypot, pi, sin

import pytest

from lfa.agents.recovery.back_up import BACK_MPS, OUT_M, TURN_PER_S, TURN_RADPS, BackUp, back_to
from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc, in_base

DT = 0.02
AHEAD = Twist(0.4, 0.2)
BESIDE = [(0.05 * n, side * 0.4) for n in range(-60, 30) for side in (-1.0, 1.0)]


def driven_in() -> tuple[BackUp, Pose2D]:
    """A robot that came along a bend."""
    back_up, pose = BackUp(), Pose2D()
    for _ in range(300):
        pose = along_arc(pose, AHEAD, DT)
        back_up.keep(pose)
    back_up.begin(pose)
    return back_up, pose


def test_it_goes_back_as_it_came_until_it_is_out() -> None:
    back_up, pose = driven_in()
    came_from, trap = along_arc(Pose2D(), AHEAD, 2.0), pose
    for _ in range(2000):
        twist = back_up.step([], pose, 0.15)
        if twist is None:
            break
        assert twist.linear_x < 0.0
        pose = along_arc(pose, twist, DT)
    assert not back_up.under_way
    assert back_up.trap == (trap.x, trap.y)
    assert hypot(pose.x - trap.x, pose.y - trap.y) > 0.9 * OUT_M
    assert hypot(pose.x - came_from.x, pose.y - came_from.y) < 0.2


def test_it_waits_while_somebody_stands_behind() -> None:
    back_up, pose = driven_in()
    for _ in range(50):
        assert back_up.step([(-0.20, 0.0)], pose, 0.15) == STILL
    assert back_up.under_way


def test_who_has_given_up_backing_drives_on_and_remembers_the_trap() -> None:
    back_up, pose = driven_in()
    back_up.end()
    assert not back_up.under_way
    assert back_up.step([], pose, 0.15) is None
    assert back_up.trap == (pose.x, pose.y)


def test_it_backs_on_the_arc_that_leads_through_its_trail() -> None:
    back_up, pose = BackUp(), Pose2D(1.0, 0.0, 0.0)
    back_up.keep(Pose2D(0.0, 0.2, 0.0))
    back_up.begin(pose)
    twist = back_up.step([], pose, 0.15)
    assert twist is not None
    way = [along_arc(pose, twist, 0.02 * n) for n in range(300)]
    assert min(hypot(at.x, at.y - 0.2) for at in way) < 0.005


def test_walls_beside_the_way_do_not_hold_it() -> None:
    back_up = BackUp()
    for n in range(30):
        back_up.keep(Pose2D(0.1 * n, 0.0, 0.0))
    back_up.begin(Pose2D(2.9, 0.0, 0.0))
    twist = back_up.step(BESIDE, Pose2D(2.9, 0.0, 0.0), 0.15)
    assert twist is not None
    assert twist.linear_x < 0.0


RADIUS_M = 0.15
CORRIDOR = [(0.03 * n, side * 0.34) for n in range(-10, 130) for side in (-1.0, 1.0)]
CORNER = [(1.0, 0.34 + 0.03 * n) for n in range(40)] + [(0.03 * n, 0.34) for n in range(34)]
"""Walls in `map`: of a corridor of 0.68 m, and the inner ones of a bend to the left out of one."""


def backs_up(came: list[Pose2D], pose: Pose2D, walls: list[tuple[float, float]]) -> float:
    """Let a robot that came over `came` back up from `pose` until it is out; return its least distance to `walls`."""
    back_up, least_m = BackUp(), 9.0
    for place in came:
        back_up.keep(place)
    back_up.begin(pose)
    for _ in range(1500):
        twist = back_up.step([in_base(pose, point) for point in walls], pose, RADIUS_M)
        if twist is None:
            return least_m
        pose = along_arc(pose, twist, DT)
        least_m = min(least_m, *(hypot(pose.x - x, pose.y - y) for x, y in walls))
    raise AssertionError(f"it stands at {pose}")


@pytest.mark.parametrize("heading", [0.6, -0.9, pi / 2, 2.4])
def test_across_a_corridor_it_turns_its_rear_to_the_trail(heading: float) -> None:
    came = [Pose2D(0.1 * n, 0.0, 0.0) for n in range(31)]
    assert backs_up(came, Pose2D(3.0, -0.14, heading), CORRIDOR) > RADIUS_M


def test_where_the_direct_way_to_its_trail_cuts_a_corner_it_backs_beside_it() -> None:
    came = [Pose2D(0.1 * n, 0.05, 0.0) for n in range(12)] + [Pose2D(1.18, 0.15 + 0.1 * n, pi / 2) for n in range(4)]
    assert backs_up(came, Pose2D(1.18, 0.43, 1.25), CORNER) > RADIUS_M


@pytest.mark.parametrize("y", [0.0, 1.0])
def test_a_loop_of_its_trail_leads_nowhere(y: float) -> None:
    back_up = BackUp()
    for x in (*range(31), *range(30, 20, -1)):
        back_up.keep(Pose2D(0.1 * x, y, 0.0))
    pose = Pose2D(2.0, y, 0.0)
    back_up.keep(pose)
    back_up.begin(pose)
    for _ in range(20):
        twist = back_up.step([], pose, RADIUS_M)
        assert twist is not None
        assert twist.linear_x < 0.0, "it turns to where it went forth and back"
        pose = along_arc(pose, twist, DT)


@pytest.mark.parametrize("heading", [0.5, -0.5])
def test_without_a_trail_the_rear_turns_to_where_most_room_is(heading: float) -> None:
    pose = Pose2D(1.5, 0.0, heading)
    twist = back_to([in_base(pose, point) for point in CORRIDOR], (-1.0, 0.0), RADIUS_M)
    assert twist.linear_x == 0.0
    assert twist.angular_z * heading < 0.0


def test_with_its_rear_on_the_way_it_drives_backwards() -> None:
    assert back_to([], (-1.0, 0.0), RADIUS_M) == Twist(-BACK_MPS, 0.0)


@pytest.mark.parametrize(
    ("off_rad", "rate_radps"), [(0.2, 0.2 * TURN_PER_S), (-0.2, -0.2 * TURN_PER_S), (1.0, TURN_RADPS)]
)
def test_the_rear_turns_the_faster_the_farther_it_is_off_the_way(off_rad: float, rate_radps: float) -> None:
    twist = back_to([], (-cos(off_rad), -sin(off_rad)), RADIUS_M)
    assert twist.linear_x == 0.0
    assert twist.angular_z == pytest.approx(rate_radps)


def test_what_bars_the_far_end_of_the_way_is_passed_too() -> None:
    assert back_to([(-1.5, 0.0)], (-2.0, 0.0), RADIUS_M).linear_x == 0.0
