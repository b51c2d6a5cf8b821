"""Wheels on terrain: each rule against its closed form, and each feature stops or passes a robot by that rule."""

from __future__ import annotations

from math import acos, atan, copysign, cos, hypot, inf, pi, sin, sqrt, tan

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from lfa.protocol.geometry import STILL, Pose2D, Twist
from lfa.world.description.load import load
from lfa.world.physics import wheel_contact
from lfa.world.physics.kinematics import Kinematic
from lfa.world.physics.rigid_bodies import Physics
from lfa.world.physics.wheel_contact import WHEEL_SIDE, Floor, dip_m, gap_m_max, speed_after_step, step_m_max

HZ = 100
RADIUS_M = 0.05
TRACTION = 40.0 / (5.0 * 9.81)
STEP_M = step_m_max(RADIUS_M, TRACTION)
GAP_M = gap_m_max(RADIUS_M, TRACTION)
EDGE_M = 1.0
"""Where the features of these worlds begin, ahead of a robot at (0, 0)."""

radii = st.floats(0.02, 0.5)
tractions = st.floats(0.1, 2.0)


def bodies(*overrides: str) -> Physics:
    return Physics(load("straight", ["mission.robots=[1]", *overrides]))


def bump(height_m: float, width_m: float = 0.3) -> str:
    middle = EDGE_M + 0.5 * width_m
    return f"world.bumps=[{{center_m=[{middle},0], width_m={width_m}, length_m=2, height_m={height_m}}}]"


def pothole(width_m: float, depth_m: float, y_m: float = 0.0, length_m: float = 2.0) -> str:
    hole = f"{{center_m=[{EDGE_M + 0.5 * width_m},{y_m}], width_m={width_m}, length_m={length_m}, depth_m={depth_m}}}"
    return f"world.potholes=[{hole}]"


def ditch(width_m: float, depth_m: float = 1.0) -> str:
    x = EDGE_M + 0.5 * width_m
    return f"world.ditches=[{{ends_m=[[{x},-2],[{x},2]], width_m={width_m}, depth_m={depth_m}}}]"


def drive(world: Physics, twist: Twist, duration_s: float) -> list[float]:
    """The robot's speed after each step."""
    speeds = []
    for _ in range(round(duration_s * HZ)):
        world.step([twist])
        speeds.append(world.twists[0].linear_x)
    return speeds


# --- the rules ---------------------------------------------------------------------------------------------------


@given(radii, tractions)
def test_the_highest_step_from_rest_has_its_contact_at_the_friction_angle(radius_m: float, traction: float) -> None:
    step_m = step_m_max(radius_m, traction)
    assert tan(acos((radius_m - step_m) / radius_m)) == pytest.approx(traction)
    assert speed_after_step(0.0, 0.999 * step_m, radius_m, traction) is not None
    assert speed_after_step(0.0, 1.001 * step_m, radius_m, traction) is None


@given(radii, tractions)
def test_the_widest_gap_from_rest_is_the_one_into_which_a_wheel_dips_by_the_highest_step(
    radius_m: float, traction: float
) -> None:
    gap_m = gap_m_max(radius_m, traction)
    assert dip_m(gap_m, radius_m, 0.0) == pytest.approx(step_m_max(radius_m, traction))
    assert sin(atan(traction)) == pytest.approx(0.5 * gap_m / radius_m)


def test_a_wheel_dips_by_the_sagitta_falls_into_what_is_wider_than_itself_and_flies_over_when_fast() -> None:
    assert dip_m(0.06, 0.05, 0.2) == pytest.approx(0.05 - 0.04)  # 3-4-5
    assert dip_m(0.1, 0.05, 0.0) == inf
    assert dip_m(0.1, 0.05, 0.2) == pytest.approx(0.5 * 9.81 * 0.5**2)
    assert dip_m(0.06, 0.05, 3.0) == pytest.approx(0.5 * 9.81 * 0.02**2)


@given(st.floats(0.01, 3.0), st.floats(0.0, 1.0), radii, tractions)
def test_a_step_within_the_friction_angle_leaves_v_cos_theta(
    speed: float, part: float, radius_m: float, traction: float
) -> None:
    step_m = part * 0.999 * step_m_max(radius_m, traction)
    assert speed_after_step(speed, step_m, radius_m, traction) == pytest.approx(speed * (1.0 - step_m / radius_m))


def test_a_higher_step_takes_what_gravity_does_beyond_traction_out_of_the_kinetic_energy() -> None:
    """The integral of the docstring, summed on its own here."""
    speed, step_m = 0.8, 0.02
    contact, friction, parts = acos(0.6), atan(TRACTION), 100_000
    angles = [friction + (contact - friction) * (i + 0.5) / parts for i in range(parts)]
    paid = sum(9.81 * RADIUS_M * (sin(a) - TRACTION * cos(a)) for a in angles) * (contact - friction) / parts
    expected = sqrt((speed * cos(contact)) ** 2 - 2.0 * paid)
    assert speed_after_step(speed, step_m, RADIUS_M, TRACTION) == pytest.approx(expected, rel=1e-6)


def test_no_speed_gets_a_wheel_up_a_step_of_its_own_radius() -> None:
    assert speed_after_step(100.0, RADIUS_M, RADIUS_M, TRACTION) is None
    assert speed_after_step(0.3, 0.0, RADIUS_M, TRACTION) == speed_after_step(0.3, -1.0, RADIUS_M, TRACTION) == 0.3


# --- the features ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("feature", "passes"),
    [
        (bump(0.99 * STEP_M), True),
        (pothole(0.99 * GAP_M, 0.5), True),
        (pothole(0.5, 0.99 * STEP_M), True),
        (ditch(0.99 * GAP_M), True),
        (pothole(0.5, 0.05, y_m=0.3, length_m=0.3), True),  # beside the left wheel, which stands at 0.12 m
        (bump(0.02), False),
        (pothole(0.09, 0.5), False),
        (pothole(0.5, 0.02), False),
        (ditch(0.3), False),
    ],
)
def test_a_feature_passes_or_stops_a_slow_robot_by_its_rule(feature: str, passes: bool) -> None:
    world = bodies(feature)
    drive(world, Twist(0.1, 0.0), 30.0)
    assert (world.poses[0].x > 2.5) is passes, f"{feature}: at {world.poses[0]}"
    assert world.wheels[0].linear_x == pytest.approx(0.1)


def test_a_run_up_carries_over_a_bump_that_stops_a_slow_robot() -> None:
    slow, fast = bodies(bump(0.02)), bodies(bump(0.02))
    assert speed_after_step(0.2, 0.02, RADIUS_M, TRACTION) is None
    assert speed_after_step(0.8, 0.02, RADIUS_M, TRACTION) is not None
    drive(slow, Twist(0.2, 0.0), 10.0)
    drive(fast, Twist(0.8, 0.0), 10.0)
    assert slow.poses[0].x < EDGE_M < 2.0 < fast.poses[0].x


@pytest.mark.parametrize("speed", [0.2, 0.5])
def test_a_bump_costs_speed_by_the_rule_and_the_drive_regains_it(speed: float) -> None:
    world = bodies(bump(0.01))
    speeds = drive(world, Twist(speed, 0.0), 10.0)
    after = speed_after_step(speed, 0.01, RADIUS_M, TRACTION)
    assert after is not None
    assert min(speeds[HZ:]) == pytest.approx(after + 1.0 / HZ)  # 1 m/s2 in the step after the edge
    assert speeds[-1] == speed


def test_a_robot_in_a_pothole_too_deep_stands_while_its_wheels_turn_and_only_its_sensors_tell() -> None:
    world = bodies(pothole(0.2, 0.05))
    drive(world, Twist(0.3, 0.0), 10.0)
    before = world.poses[0]
    drive(world, Twist(0.3, 0.0), 5.0)
    assert world.poses[0] == before
    assert EDGE_M < before.x < EDGE_M + 0.2
    assert (world.twists[0], world.wheels[0]) == (STILL, Twist(0.3, 0.0))


def test_a_robot_that_fell_into_a_hole_gets_out_neither_forward_nor_back_nor_by_turning() -> None:
    world = bodies(pothole(0.6, 0.06))
    drive(world, Twist(0.5, 0.0), 5.0)
    for twist in (Twist(-0.3, 0.0), Twist(0.0, 1.0), Twist(0.5, 0.3), Twist(-0.3, -2.0), Twist(1.0, 0.0)):
        drive(world, twist, 4.0)
        assert EDGE_M < world.poses[0].x < EDGE_M + 0.6


def test_one_wheel_in_a_hole_makes_the_robot_turn_about_it() -> None:
    world = bodies(pothole(0.1, 0.06, y_m=0.12, length_m=0.1))
    drive(world, Twist(0.3, 0.0), 3.9)
    before = world.poses[0]
    drive(world, Twist(0.3, 0.0), 0.5)
    after = world.poses[0]
    held = [(p.x - 0.12 * sin(p.theta), p.y + 0.12 * cos(p.theta)) for p in (before, after)]
    assert hypot(held[1][0] - held[0][0], held[1][1] - held[0][1]) < 1e-6
    assert after.theta - before.theta == pytest.approx(0.3 / 0.24 * 0.5, rel=1e-3)


def test_backing_away_from_a_bump_that_is_too_high_is_free() -> None:
    world = bodies(bump(0.1))
    drive(world, Twist(0.5, 0.0), 4.0)
    drive(world, Twist(-0.3, 0.0), 4.0)
    assert world.poses[0].x < 0.3


def test_a_ditch_met_aslant_is_wider_by_the_angle() -> None:
    """Crossed at 45 degrees, 5.5 cm are 7.8 cm to a slow wheel, which cannot get out of more than 6.3 cm."""
    width_m = 0.055
    straight, aslant = bodies(ditch(width_m)), bodies(ditch(width_m), f"world.starts=[[0,0,{pi / 4}]]")
    for world in (straight, aslant):
        drive(world, Twist(0.05, 0.0), 45.0)
    assert straight.poses[0].x > 2.0
    assert aslant.poses[0].x < EDGE_M + 0.2


def test_a_push_does_not_lift_a_robot_out_of_a_hole() -> None:
    starts = "world.starts=[[1.3,0,0],[0,0,0]]"
    world = Physics(load("straight", ["mission.robots=[1,2]", starts, pothole(0.6, 0.06).replace("[1.3,", "[1.9,")]))
    for step in range(20 * HZ):
        world.step([Twist(0.3, 0.0) if step < 3 * HZ else STILL, Twist(0.5, 0.0)])
    assert 1.6 < world.poses[0].x < 2.2
    assert world.poses[1].x < world.poses[0].x


@pytest.mark.parametrize(("feature", "height_m"), [(bump(0.03, width_m=0.6), 0.03), (pothole(0.6, 0.06), -0.06)])
def test_a_world_that_resumes_has_robots_standing_where_they_were(feature: str, height_m: float) -> None:
    scenario = load("straight", ["mission.robots=[1]", feature])
    on_it = replace(scenario, world=replace(scenario.world, starts=((EDGE_M + 0.3, 0.0, 0.0),)))
    world = Physics(on_it)
    assert world.standing_m() == [height_m]
    drive(world, Twist(0.2, 0.0), 6.0)
    assert (world.poses[0].x > 1.7) is (height_m > 0.0)


def test_terrain_off_the_way_changes_no_bit_of_a_motion() -> None:
    features = [bump(0.05).replace("0], width", "5], width"), ditch(0.2).replace("-2]", "4]").replace(",2]]", ",6]]")]
    plain, beside = bodies(), bodies(*features)
    for twist in (Twist(0.5, 0.3), Twist(0.2, -0.7), Twist(-0.3, 0.1)):
        drive(plain, twist, 3.0)
        drive(beside, twist, 3.0)
        assert plain.poses == beside.poses


def test_kinematic_bodies_go_over_everything() -> None:
    world = Kinematic(load("straight", ["mission.robots=[1]", ditch(0.5)]))
    for _ in range(10 * HZ):
        world.step([Twist(0.5, 0.0)])
    assert world.poses[0].x > 4.0
    assert world.standing_m() == [0.0]


def test_a_floor_that_lets_everything_pass_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    """The planted bug: were the rule not asked, the ditch would stop nobody."""
    monkeypatch.setattr(wheel_contact, "speed_after_step", lambda speed, *_: speed)
    world = bodies(ditch(0.3))
    drive(world, Twist(0.1, 0.0), 30.0)
    assert world.poses[0].x > 2.5


# --- one wheel at an edge ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("pose", "twist", "climbs"),
    [
        (Pose2D(0.999, -0.4, 0.0), Twist(0.4, 0.0), 0),  # the bump lies ahead of the left wheel alone
        (Pose2D(0.999, 1.4, 0.0), Twist(0.4, 0.0), 1),
        (Pose2D(0.999, -0.4, pi), Twist(-0.4, 0.0), 1),  # backwards
        (Pose2D(0.999, 0.5, 0.0), Twist(0.0, 3.0), 1),  # on the spot: one wheel goes ahead
        (Pose2D(0.999, 0.5, 0.0), Twist(0.0, -3.0), 0),
    ],
)
def test_a_wheel_that_climbs_alone_loses_its_speed_alone(pose: Pose2D, twist: Twist, climbs: int) -> None:
    height_m, side_m = 0.002, WHEEL_SIDE * 0.15
    edge_y = {-0.4: (-0.4, 0.0), 1.4: (1.0, 1.4), 0.5: (0.5, 0.5)}[pose.y]
    length_m = 1.4 if edge_y[0] != edge_y[1] else 2.0
    low = edge_y[0] if pose.y < 0.0 else edge_y[1] - length_m if pose.y > 1.0 else -0.5
    middle = low + 0.5 * length_m
    feature = f"world.bumps=[{{center_m=[1.15,{middle}], width_m=0.3, length_m={length_m}, height_m={height_m}}}]"
    floor = Floor(load("straight", ["mission.robots=[1]", feature]))
    assert floor.near(0, pose)
    rims = [twist.linear_x - side_m * twist.angular_z, twist.linear_x + side_m * twist.angular_z]
    after = speed_after_step(abs(rims[climbs]), height_m, RADIUS_M, TRACTION)
    assert after is not None
    through, slowed = floor.roll(0, pose, twist, twist)
    assert through == twist
    rims[climbs] = copysign(after, rims[climbs])
    assert slowed.linear_x == pytest.approx(0.5 * (rims[0] + rims[1]))
    assert slowed.angular_z == pytest.approx(0.5 * (rims[1] - rims[0]) / side_m)
