"""Bodies, fact by fact: forces along every axis, touches counted once each, moving and pushable things, real robots."""

from __future__ import annotations

from math import cos, pi, sin

import pytest

from lfa.protocol.geometry import STILL, Pose2D, Twist, distance, wrap
from lfa.world.description.load import draw, load
from lfa.world.description.scenario import Obstacle
from lfa.world.physics.kinematics import Kinematic
from lfa.world.physics.rigid_bodies import Physics
from tests.world.physics.test_rigid_bodies import bodies, drive, eq1

KINDS = [Physics, Kinematic]
ALONG = "world.obstacles=[{center_m=[2,-2], radius_m=0.3, waypoints_m=[[5,2]], speed_mps=0.5, phase=0.1}]"
"""An obstacle that goes to and fro on 5 m, along both axes, and is 1 m on its way at the start."""
PUSH_N, MASS_KG, RADIUS_M = 2.0, 5.0, 0.15


@pytest.mark.parametrize("kind", KINDS)
def test_a_moving_obstacle_is_where_its_way_is_at_that_time(kind: type[Physics] | type[Kinematic]) -> None:
    for begins_s in (0.0, 2.0):
        world = bodies(ALONG, kind=kind)
        if begins_s > 0.0:
            world.advance(round(begins_s * 100))
        for driven_s in (0.0, 0.01, 1.0):
            drive(world, STILL, driven_s)
            begins_s += driven_s
            way_m = 1.0 + 0.5 * begins_s
            place = world.moved()[0]
            assert (place.x, place.y) == (pytest.approx(2.0 + 0.6 * way_m), pytest.approx(-2.0 + 0.8 * way_m))
        assert world.poses == [Pose2D()]


@pytest.mark.parametrize("kind", KINDS)
def test_a_real_robot_is_where_it_reports_to_be(kind: type[Physics] | type[Kinematic]) -> None:
    world = bodies(kind=kind)
    world.place(0, Pose2D(3.0, 1.0, 0.5))
    assert world.poses == [Pose2D(3.0, 1.0, 0.5)]
    drive(world, Twist(0.5, 0.0), 1.0)
    assert distance(world.poses[0], Pose2D(3.0, 1.0, 0.5)) == pytest.approx(0.37, abs=0.02)
    assert wrap(world.poses[0].theta - 0.5) == pytest.approx(0.0, abs=1e-9)


def test_an_obstacle_that_is_set_down_stops_a_robot() -> None:
    world = bodies()
    world.set_down(7, Obstacle(center_m=(1.0, 0.0), radius_m=0.3))
    assert [touch.other for touch in drive(world, Twist(0.5, 0.0), 5.0)] == ["obstacle7"]
    assert world.poses[0].x == pytest.approx(0.55, abs=0.003)


@pytest.mark.parametrize("things", ["world.walls_m=[[1,-3,1,3]]", "world.obstacles=[{center_m=[1.2,0], radius_m=0.2}]"])
def test_after_each_touch_free_motion_is_equation_1_again(things: str) -> None:
    """Else a touch is counted more often than it began or ended."""
    world = bodies(things)
    curve = Twist(-0.3, 0.5)
    for _ in range(3):
        world.place(0, Pose2D())
        drive(world, Twist(0.5, 0.0), 3.0)
        assert world.twists[0].linear_x == pytest.approx(0.0, abs=0.01), "it is held"
        assert world.wheels[0] == Twist(0.5, 0.0), "its wheels slip"
        drive(world, curve, 2.0)
        before = world.poses[0]
        drive(world, curve, 2.0)
        expected = eq1(before, curve, 2.0)
        assert distance(world.poses[0], expected) < 1e-9
        assert world.twists[0] == curve


def test_a_touch_is_of_the_robot_that_touches_alone() -> None:
    overrides = ["mission.robots=[1,2]", "world.starts=[[0,0,0],[0,2,0]]", "world.walls_m=[[0.5,-0.5,0.5,0.5]]"]
    world = Physics(load("straight", [*overrides, "world.obstacles=[{center_m=[1,2], radius_m=0.2}]"]))
    touches = [touch for _ in range(300) for touch in world.step([Twist(0.5, 0.0), STILL])]
    assert [(touch.robot, touch.other) for touch in touches] == [(0, "wall0")]
    assert world.twists == [Twist(pytest.approx(0.0, abs=1e-6), pytest.approx(0.0, abs=1e-6)), STILL]
    touches = [touch for _ in range(300) for touch in world.step([Twist(0.5, 0.0), Twist(0.5, 0.0)])]
    assert [(touch.robot, touch.other) for touch in touches] == [(1, "obstacle0")]


def test_in_a_corner_a_robot_touches_both_walls() -> None:
    world = bodies("world.walls_m=[[1,-3,1,3],[-3,0.15,3,0.15]]", "world.starts=[[0,0,0.3]]")
    drive(world, Twist(0.5, 0.0), 6.0)
    drive(world, Twist(-0.3, 0.0), 0.5)  # away from both
    drive(world, Twist(0.0, 0.5), 2.0)
    assert {touch.other for touch in drive(world, Twist(0.5, 0.0), 6.0)} <= {"wall0", "wall1"}
    assert world.poses[0].x < 1.0 - 0.148
    assert world.poses[0].y < 0.002


def test_wheels_accelerate_a_robot_by_no_more_than_their_force_and_torque() -> None:
    nimble = ("mission.limits.a_max_mps2=100.0", "mission.limits.alpha_max_radps2=100.0")
    time_s = 0.5
    world = bodies(f"world.body.push_n={PUSH_N}", *nimble)
    drive(world, Twist(1.0, 0.0), time_s)
    assert world.poses[0].x == pytest.approx(0.5 * PUSH_N / MASS_KG * time_s**2, rel=0.03)
    world = bodies(f"world.body.push_n={PUSH_N}", *nimble)
    drive(world, Twist(0.0, 20.0), time_s)
    inertia = 0.5 * MASS_KG * RADIUS_M**2
    turned = min(2.0 * time_s, 0.5 * PUSH_N * RADIUS_M / inertia * time_s**2)
    assert world.poses[0].theta == pytest.approx(turned, rel=0.2)


def pushed_m(heading: float) -> float:
    """How far [m] ahead of a start with this heading a light thing is that the robot has pushed for a while."""
    thing = f"center_m=[{cos(heading)},{sin(heading)}], radius_m=0.3, mass_kg=5"
    world = bodies(f"world.obstacles=[{{{thing}}}]", f"world.starts=[[0,0,{heading}]]")
    drive(world, Twist(0.5, 0.0), 5.0)
    assert world.twists[0].linear_x == pytest.approx(0.46, abs=0.01)
    place = world.moved()[0]
    return place.x * cos(heading) + place.y * sin(heading)


@pytest.mark.parametrize("heading", [0.25 * pi, 0.5 * pi, -0.75 * pi])
def test_a_light_thing_is_pushed_as_far_in_every_direction(heading: float) -> None:
    assert pushed_m(heading) == pytest.approx(pushed_m(0.0), abs=1e-3)
    assert pushed_m(heading) > 2.5


def test_a_robot_that_pushes_on_a_wall_can_turn() -> None:
    world = bodies("world.walls_m=[[0.5,-3,0.5,3]]")
    drive(world, Twist(0.5, 0.0), 2.0)
    drive(world, Twist(0.2, 0.5), 2.0)
    assert 0.2 < world.poses[0].theta < 1.0


@pytest.mark.parametrize("middle", [(3.0, 0.0), (0.0, 3.0)])
def test_robots_that_start_in_each_other_part_freely_anywhere(middle: tuple[float, float]) -> None:
    x, y = middle
    starts = f"world.starts=[[{x},{y},0],[{x},{y},0]]"
    scenario = draw(load("straight", ["mission.robots=[1,2]", starts, "world.starts_coincide=true"]), 0)
    world = Physics(scenario)
    assert [touch for _ in range(200) for touch in world.step([Twist(0.5, 0.0), STILL])] == []
    assert world.poses[1] == Pose2D(x, y, 0.0)
