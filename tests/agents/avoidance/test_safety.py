"""The last function before cmd_vel: finite, within the limits, and able to stop in time, whatever comes in."""

from math import cos, hypot, inf, isfinite, nan, sin, sqrt
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfa.agents.avoidance.safety import (
    BRAKING_SHARE,
    OBEYED_MPS,
    OBEYED_RADPS,
    SKIN_M,
    TURNING_MPS,
    obeyed,
    safe,
    sharing,
    turn_on_spot,
    within,
)
from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc, in_base
from lfa.protocol.mission import Limits

LIMITS = Limits()
DT = 0.02
numbers = st.floats(allow_nan=True, allow_infinity=True)
speeds = st.builds(Twist, st.floats(-0.3, 1.0), st.floats(-2.0, 2.0))
points = st.lists(st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)), max_size=20)


@given(numbers, numbers, speeds, points)
def test_what_goes_out_is_finite_and_within_limits_and_accelerations(
    v: float, w: float, last: Twist, seen: list
) -> None:
    out = safe(Twist(v, w), last, seen, 0.15, LIMITS, DT)
    assert isfinite(out.linear_x)
    assert isfinite(out.angular_z)
    assert -LIMITS.v_reverse_max_mps - 1e-9 <= out.linear_x <= LIMITS.v_max_mps + 1e-9
    assert abs(out.angular_z) <= LIMITS.omega_max_radps + 1e-9
    assert abs(out.linear_x - last.linear_x) <= LIMITS.a_max_mps2 * DT + 1e-9
    assert abs(out.angular_z - last.angular_z) <= LIMITS.alpha_max_radps2 * DT + 1e-9


@pytest.mark.parametrize("bad", [nan, inf, -inf])
def test_a_number_that_is_none_means_stand_still(bad: float) -> None:
    assert safe(Twist(bad, 0.0), STILL, [], 0.15, LIMITS, DT) == STILL
    assert safe(Twist(0.5, bad), STILL, [], 0.15, LIMITS, DT) == STILL


@given(st.floats(0.2, 3.0))
def test_a_robot_that_drives_at_a_wall_stops_before_it(start_m: float) -> None:
    ahead, last = start_m, STILL
    for _ in range(1000):
        last = safe(Twist(1.0, 0.0), last, [(ahead, 0.0)], 0.15, LIMITS, DT)
        ahead -= last.linear_x * DT
    assert ahead >= 0.15
    assert abs(last.linear_x) < 0.01


def test_the_speed_before_an_obstacle_leaves_the_way_to_stop() -> None:
    out = safe(Twist(1.0, 0.0), Twist(1.0, 0.0), [(0.15 + SKIN_M + 0.5, 0.0)], 0.15, LIMITS, 1.0)
    assert out.linear_x**2 / (2.0 * BRAKING_SHARE * LIMITS.a_max_mps2) == pytest.approx(0.5)


@given(st.floats(-5.0, 5.0), st.floats(-9.0, 9.0))
def test_limits_keep_the_shape_of_the_path(v: float, w: float) -> None:
    out_v, out_w = within(Twist(v, w), LIMITS)
    assert out_v * w == pytest.approx(out_w * v, abs=1e-9)


def test_two_robots_that_meet_each_stop_within_half_of_the_room() -> None:
    for apart in (0.4, 0.8, 1.5, 3.0):
        out = sharing(Twist(1.0, 0.2), [(apart, 0.0)], 0.15, LIMITS)
        way = out.linear_x**2 / (2.0 * BRAKING_SHARE * LIMITS.a_max_mps2)
        assert way <= max(0.0, 0.5 * (apart - 0.3) - SKIN_M) + 1e-9
        assert out.angular_z * 1.0 == pytest.approx(0.2 * out.linear_x)


def test_a_team_mate_that_the_robot_turns_towards_is_ahead_before_its_nose_is() -> None:
    """Half a second later it would be before the nose, too near to stop (explore, seed 1)."""
    beside = (0.10, 0.45)
    assert sharing(Twist(0.65, 0.0), [beside], 0.15, LIMITS) == Twist(0.65, 0.0)
    assert sharing(Twist(0.65, -1.5), [beside], 0.15, LIMITS) == Twist(0.65, -1.5)
    assert sharing(Twist(0.65, 1.5), [beside], 0.15, LIMITS).linear_x < 0.4


def test_a_team_mate_beside_or_behind_slows_nobody() -> None:
    for place in ((0.1, 0.5), (-0.5, 0.0)):
        assert sharing(Twist(0.5, 0.0), [place], 0.15, LIMITS) == Twist(0.5, 0.0)
    assert sharing(Twist(-0.3, 0.0), [(-0.4, 0.0)], 0.15, LIMITS).linear_x > -0.3


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("turn_radps", "slowed"), [(0.0, False), (1.5, True), (-1.5, False)])
def test_a_team_mate_80_degrees_aside_counts_only_where_the_robot_turns(
    side: float, turn_radps: float, slowed: bool
) -> None:
    mate = (0.5 * cos(1.4), side * 0.5 * sin(1.4))
    out = sharing(Twist(0.6, side * turn_radps), [mate], 0.15, LIMITS)
    assert (out.linear_x < 0.59) is slowed


@pytest.mark.parametrize("turn_radps", [-2.0, 2.0])
def test_a_team_mate_straight_ahead_counts_however_the_robot_turns(turn_radps: float) -> None:
    assert sharing(Twist(0.6, turn_radps), [(0.5, 0.0)], 0.15, LIMITS).linear_x < 0.5


def test_the_nearest_of_several_team_mates_decides() -> None:
    near, far = (0.5, 0.0), (1.0, 0.1)
    alone = sharing(Twist(0.9, 0.0), [near], 0.15, LIMITS)
    assert sharing(Twist(0.9, 0.0), [near, far], 0.15, LIMITS) == alone
    assert sharing(Twist(0.9, 0.0), [far, near], 0.15, LIMITS).linear_x == pytest.approx(alone.linear_x)


@pytest.mark.parametrize(("wanted", "first"), [(1.0, 0.02), (-0.3, -0.02), (0.01, 0.01)])
def test_a_command_changes_by_one_step_of_acceleration(wanted: float, first: float) -> None:
    out = safe(Twist(wanted, 10.0 * wanted), STILL, [], 0.15, LIMITS, DT)
    assert out.linear_x == pytest.approx(first)
    assert abs(out.angular_z) <= LIMITS.alpha_max_radps2 * DT + 1e-12


def test_backwards_has_a_limit_of_its_own() -> None:
    assert within(Twist(-1.0, 0.5), LIMITS) == pytest.approx((-0.3, 0.15))
    assert within(Twist(0.2, 4.0), LIMITS) == pytest.approx((0.1, 2.0))


@pytest.mark.parametrize("a_max_mps2", [0.5, 2.0])
def test_a_weak_drive_drives_slower_towards_a_wall(a_max_mps2: float) -> None:
    limits = Limits(v_max_mps=3.0, a_max_mps2=a_max_mps2)
    out = safe(Twist(3.0, 0.0), Twist(3.0, 0.0), [(1.17, 0.0)], 0.15, limits, 10.0)
    assert out.linear_x == pytest.approx((2.0 * BRAKING_SHARE * a_max_mps2 * 1.0) ** 0.5)


@pytest.mark.parametrize(("apart_m", "a_max_mps2"), [(0.5, 1.0), (1.0, 0.5), (1.5, 2.0)])
def test_towards_a_team_mate_a_robot_uses_its_half_of_the_room_and_no_less(apart_m: float, a_max_mps2: float) -> None:
    room_m = 0.5 * (apart_m - 2.0 * 0.15) - SKIN_M
    out = sharing(Twist(2.5, 0.0), [(apart_m, 0.0)], 0.15, Limits(a_max_mps2=a_max_mps2))
    assert out.linear_x == pytest.approx((2.0 * BRAKING_SHARE * a_max_mps2 * room_m) ** 0.5)


def test_a_slow_turn_does_not_make_a_team_mate_aside_one_ahead() -> None:
    mate = (0.5 * cos(1.4), 0.5 * sin(1.4))
    assert sharing(Twist(0.6, 0.5), [mate], 0.15, LIMITS) == Twist(0.6, 0.5)


@pytest.mark.parametrize("ahead_m", [0.0002, 0.0005, 0.002])
def test_what_stands_before_its_nose_does_not_hold_the_turn_that_frees_a_robot(ahead_m: float) -> None:
    wanted = Twist(0.05, 1.0)
    out = safe(wanted, wanted, [(0.15 + SKIN_M + ahead_m, 0.0)], 0.15, LIMITS, 1.0)
    assert 0.0 < out.linear_x < TURNING_MPS
    assert out.angular_z == pytest.approx(max(out.linear_x / wanted.linear_x, 1.0 - out.linear_x / TURNING_MPS))


def test_before_a_far_obstacle_the_turn_slows_with_the_motion() -> None:
    wanted = Twist(0.9, 0.1)
    out = safe(wanted, wanted, [(0.6, 0.0)], 0.15, LIMITS, 1.0)
    assert TURNING_MPS < out.linear_x < 0.9
    assert out.angular_z == pytest.approx(0.1 * out.linear_x / 0.9)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("off_mps", "off_radps", "obeys"),
    [(0.9, 0.9, True), (-0.9, -0.9, True), (1.1, 0.0, False), (0.0, 1.1, False), (-1.1, 0.2, False)],
)
def test_the_published_twist_is_the_command_unless_the_wheels_do_something_else(
    sign: float, off_mps: float, off_radps: float, obeys: bool
) -> None:
    command = Twist(sign * 0.4, sign * 0.8)
    measured = Twist(command.linear_x + off_mps * OBEYED_MPS, command.angular_z + off_radps * OBEYED_RADPS)
    assert obeyed(command, measured) == (command if obeys else measured)


def test_towards_a_team_mate_the_path_keeps_its_shape() -> None:
    out = sharing(Twist(0.6, 0.3), [(0.5, 0.0)], 0.15, LIMITS)
    assert out.linear_x < 0.5
    assert out.angular_z == pytest.approx(0.5 * out.linear_x)


@pytest.mark.parametrize(
    ("bearing", "radps"),
    [(3.0, 2.0), (-3.0, -2.0), (0.1, sqrt(0.8)), (-0.1, -sqrt(0.8))],
)
def test_a_turn_on_the_spot_is_at_the_drives_rate_from_which_it_stops_at_the_bearing(
    bearing: float, radps: float
) -> None:
    limits = Limits(omega_max_radps=2.0, alpha_max_radps2=4.0)
    assert turn_on_spot(bearing, inf, limits) == Twist(0.0, pytest.approx(radps))
    assert abs(turn_on_spot(bearing, 0.2, limits).angular_z) == pytest.approx(0.2)


@pytest.mark.parametrize("lag_s", [0.05, 0.16])
def test_the_way_that_two_robots_drive_until_they_brake_is_left_free(lag_s: float) -> None:
    for apart_m in (0.6, 1.0, 2.0):
        out = sharing(Twist(2.5, 0.0), [(apart_m, 0.0)], 0.15, LIMITS, lag_s)
        way_m = out.linear_x * lag_s + out.linear_x**2 / (2.0 * BRAKING_SHARE * LIMITS.a_max_mps2)
        assert way_m == pytest.approx(0.5 * (apart_m - 0.3) - SKIN_M)


@pytest.mark.parametrize("seed", [10, 11, 48])
def test_whatever_is_wanted_next_a_round_robot_touches_nothing(seed: int) -> None:
    """Another bend, and rest, are reached later than they are wanted: until then the drive is on other arcs."""
    chance, start, last, wanted = Random(seed), Pose2D(), STILL, STILL
    drawn = [(chance.uniform(-1.2, 1.2), chance.uniform(-1.2, 1.2)) for _ in range(8)]
    posts = [post for post in drawn if hypot(*post) > 0.2]
    pose = start
    for n in range(2000):
        if n % 20 == 0:
            wanted = Twist(chance.choice((1.0, 0.5, 0.2, 0.0, -0.3)), chance.choice((-2.0, -1.0, 0.0, 1.0, 2.0)))
        last = safe(wanted, last, [in_base(pose, post) for post in posts], 0.15, LIMITS, DT)
        pose = along_arc(pose, last, DT)
        assert min(hypot(x - pose.x, y - pose.y) for x, y in posts) > 0.15
        if hypot(pose.x, pose.y) > 2.0:
            pose, last = start, STILL


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_robot_that_is_to_turn_at_speed_brakes_past_the_corner_that_the_turn_leads_to(side: float) -> None:
    """It drove on into the corner of a passage while it slowed down: the turn that it wanted was free, on the spot."""
    corner, pose, last = (0.45, side * 0.27), Pose2D(), Twist(1.0, 0.0)
    for _ in range(60):
        last = safe(Twist(0.0, side * 2.0), last, [in_base(pose, corner)], 0.15, LIMITS, DT)
        pose = along_arc(pose, last, DT)
        assert hypot(corner[0] - pose.x, corner[1] - pose.y) > 0.15
