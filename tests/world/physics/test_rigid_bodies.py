"""Bodies: free motion is equation (1) exactly, what touches collides and pushes, and equal calls give equal bits."""

from __future__ import annotations

import subprocess
import sys
from math import cos, hypot, pi, sin
from random import Random

import pytest

from lfa.protocol.geometry import STILL, Pose2D, Twist, distance, wrap
from lfa.world.description.load import Obstacle, load
from lfa.world.description.obstacle_motion import ToAndFro
from lfa.world.physics.kinematics import Kinematic, Touch
from lfa.world.physics.rigid_bodies import Physics

HZ = 100
ALONE = ["mission.robots=[1]"]
MOVER = "world.obstacles=[{center_m=[2,-2], radius_m=0.3, waypoints_m=[[2,2]], speed_mps=0.4}]"


def bodies(*overrides: str, kind: type[Physics] | type[Kinematic] = Physics) -> Physics | Kinematic:
    return kind(load("straight", [*ALONE, *overrides]))


def drive(world: Physics | Kinematic, twist: Twist, duration_s: float) -> list[Touch]:
    """All robots drive with `twist`; the touches on the way."""
    wanted = [twist] * len(world.poses)
    return [touch for _ in range(round(duration_s * HZ)) for touch in world.step(wanted)]


def eq1(pose: Pose2D, twist: Twist, duration_s: float) -> Pose2D:
    """Equation (1) in the closed form of control.md 1.1, written on its own here."""
    v, w = twist.linear_x, twist.angular_z
    end = pose.theta + w * duration_s
    if w == 0.0:
        x, y = pose.x + v * duration_s * cos(end), pose.y + v * duration_s * sin(end)
    else:
        x, y = pose.x + v / w * (sin(end) - sin(pose.theta)), pose.y - v / w * (cos(end) - cos(pose.theta))
    return Pose2D(x, y, wrap(end))


@pytest.mark.parametrize("kind", [Physics, Kinematic])
@pytest.mark.parametrize("twist", [Twist(0.5, 0.0), Twist(1.0, 2.0), Twist(-0.3, 0.7), Twist(0.0, -2.0)])
def test_free_motion_is_equation_1(kind: type[Physics] | type[Kinematic], twist: Twist) -> None:
    world = bodies(kind=kind)
    drive(world, twist, 2.0)  # until the drive has reached the twist
    before = world.poses[0]
    drive(world, twist, 10.0)
    expected = eq1(before, twist, 10.0)
    assert distance(world.poses[0], expected) < 1e-9
    assert abs(wrap(world.poses[0].theta - expected.theta)) < 1e-9
    assert world.twists[0] == world.wheels[0] == twist


def test_engine_and_plain_kinematics_agree_as_long_as_nothing_touches() -> None:
    chance = Random(1)
    engine, plain = bodies(), bodies(kind=Kinematic)
    for _ in range(60):
        twist = Twist(chance.uniform(-0.5, 1.2), chance.uniform(-3.0, 3.0))
        assert drive(engine, twist, 0.5) == drive(plain, twist, 0.5) == []
        assert distance(engine.poses[0], plain.poses[0]) < 1e-9


def test_the_drive_keeps_the_limits_of_the_mission() -> None:
    world = bodies()
    before = STILL
    for wanted in (Twist(9.0, 9.0), Twist(-9.0, -9.0)):
        for _ in range(300):
            world.step([wanted])
            now = world.wheels[0]
            assert -0.3 <= now.linear_x <= 1.0
            assert abs(now.angular_z) <= 2.0
            assert abs(now.linear_x - before.linear_x) <= 1.0 / HZ + 1e-12
            assert abs(now.angular_z - before.angular_z) <= 4.0 / HZ + 1e-12
            before = now
    assert before == Twist(-0.3, -2.0)


def test_a_wall_stops_a_robot_and_its_wheels_slip() -> None:
    world = bodies("world.walls_m=[[2,-3,2,3]]")
    touches = drive(world, Twist(0.5, 0.0), 8.0)
    assert [touch.other for touch in touches] == ["wall0"], "one touch, however long it lasts"
    assert touches[0].x == pytest.approx(2.0, abs=0.01)
    assert world.poses[0].x == pytest.approx(2.0 - 0.15, abs=0.002)
    assert world.twists[0].linear_x == pytest.approx(0.0, abs=1e-6)
    assert world.wheels[0] == Twist(0.5, 0.0)


def test_a_robot_leaves_a_wall_as_fast_as_it_can_drive() -> None:
    world = bodies("world.walls_m=[[2,-3,2,3]]")
    drive(world, Twist(0.5, 0.0), 6.0)
    drive(world, Twist(-0.3, 0.0), 2.0)
    assert world.twists[0] == Twist(-0.3, 0.0)


def test_a_robot_slides_along_a_wall_that_it_meets_askew() -> None:
    world = bodies("world.walls_m=[[0,1,10,1]]", "world.starts=[[0,0,0.3]]")
    drive(world, Twist(0.5, 0.0), 10.0)
    assert world.poses[0].y <= 1.0 - 0.15 + 0.002
    assert world.poses[0].x > 3.0


def test_a_light_obstacle_is_pushed_and_comes_to_rest() -> None:
    world = bodies("world.obstacles=[{center_m=[1,0], radius_m=0.3, mass_kg=5}]")
    drive(world, Twist(0.5, 0.0), 5.0)
    pushed = world.moved()[0].x
    assert pushed > 1.5
    assert pushed - world.poses[0].x == pytest.approx(0.45, abs=0.003)
    drive(world, STILL, 1.0)
    rest = world.moved()[0]
    drive(world, STILL, 1.0)
    assert world.moved()[0] == rest
    assert rest.x < pushed + 0.5, "friction with the ground brakes it"


def test_an_obstacle_heavier_than_the_wheels_can_push_stays() -> None:
    world = bodies(
        "world.obstacles=[{center_m=[1,0], corners_m=[[-0.2,-0.2],[0.2,-0.2],[0.2,0.2],[-0.2,0.2]], mass_kg=20}]"
    )
    drive(world, Twist(0.5, 0.0), 5.0)
    assert world.moved()[0].x == pytest.approx(1.0, abs=0.01)
    assert world.twists[0].linear_x == pytest.approx(0.0, abs=0.01)


def test_a_polygon_pushed_off_its_centre_turns() -> None:
    box = "corners_m=[[-0.2,-0.2],[0.2,-0.2],[0.2,0.2],[-0.2,0.2]]"
    world = bodies(f"world.obstacles=[{{center_m=[1,0.15], {box}, mass_kg=3}}]")
    drive(world, Twist(0.5, 0.0), 4.0)
    assert world.moved()[0].theta > 0.1


def test_an_obstacle_nailed_down_stops_a_robot() -> None:
    world = bodies("world.obstacles=[{center_m=[1,0], radius_m=0.3}]")
    assert [touch.other for touch in drive(world, Twist(0.5, 0.0), 5.0)] == ["obstacle0"]
    assert hypot(world.poses[0].x - 1.0, world.poses[0].y) >= 0.448


def test_two_robots_that_meet_both_feel_it_and_neither_passes() -> None:
    world = Physics(load("straight", ["mission.robots=[1,2]", f"world.starts=[[0,0,0],[2,0,{pi}]]"]))
    touches = drive(world, Twist(0.5, 0.0), 5.0)
    assert [(touch.robot, touch.other) for touch in touches] == [(0, "robot2"), (1, "robot1")]
    assert distance(*world.poses) == pytest.approx(0.3, abs=0.003)


def test_a_robot_pushes_one_that_stands() -> None:
    world = Physics(
        load("straight", ["mission.robots=[1,2]", "world.starts=[[0,0,0],[1,0,0]]", "world.body.push_n=20"])
    )
    for _ in range(500):
        world.step([Twist(0.5, 0.0), STILL])
    assert distance(*world.poses) >= 0.298
    assert world.poses[1].x > 1.0


@pytest.mark.parametrize("kind", [Physics, Kinematic])
def test_a_moving_obstacle_goes_to_and_fro(kind: type[Physics] | type[Kinematic]) -> None:
    world = bodies(MOVER, kind=kind)
    for time_s, y in ((5.0, 0.0), (5.0, 2.0), (5.0, 0.0), (5.0, -2.0)):
        drive(world, STILL, time_s)
        assert world.moved()[0] == Pose2D(2.0, pytest.approx(y, abs=1e-9), 0.0)


def test_a_moving_obstacle_keeps_its_course_whatever_it_meets() -> None:
    world = bodies(MOVER, "world.starts=[[2,0,0]]")
    touches = drive(world, STILL, 8.0)
    assert [touch.other for touch in touches] == ["obstacle0"]
    assert world.moved()[0].y == pytest.approx(1.2, abs=1e-9)
    assert world.poses[0].y > 1.6, "the robot was pushed out of its way"


@pytest.mark.parametrize(("phase", "place"), [(0.0, 0.0), (0.25, 1.0), (0.5, 2.0), (0.75, 1.0)])
def test_phase_is_a_part_of_the_way_there_and_back(phase: float, place: float) -> None:
    way = ToAndFro(Obstacle(center_m=(0, 0), radius_m=0.2, waypoints_m=((1, 0), (1, 1)), speed_mps=0.1, phase=phase))
    x, y = way.at(0.0)
    assert x + y == pytest.approx(place)


def test_a_touch_that_flickers_is_one_touch() -> None:
    nimble = ("mission.limits.a_max_mps2=100.0", "world.body.push_n=4000.0")
    world = bodies("world.walls_m=[[0.5,-3,0.5,3]]", *nimble)
    touches = drive(world, Twist(0.3, 0.0), 3.0)
    for _ in range(20):
        touches += drive(world, Twist(-0.3, 0.0), 0.04) + drive(world, Twist(0.3, 0.0), 0.1)
    assert len(touches) == 1
    touches += drive(world, Twist(-0.3, 0.0), 1.0) + drive(world, Twist(0.3, 0.0), 2.0)
    assert len(touches) == 2, "a second approach is a second touch"


CROWD = """
from random import Random
from lfa.protocol.geometry import Twist
from lfa.world.physics.rigid_bodies import Physics
from lfa.world.description.load import load
overrides = ["world.walls_m=[[-2,-2,4,-2],[4,-2,4,4],[4,4,-2,4],[-2,4,-2,-2]]", "mission.formation.separation_m=0.6",
    "mission.leading.route_m=[[3.0, 3.0]]",
    "world.obstacles=[{center_m=[1,0.3],radius_m=0.2,mass_kg=4},{center_m=[2,1],corners_m=[[0,0],[0.3,0],[0,0.3]],mass_kg=2}]"]
world, chance = Physics(load("straight", overrides, robots=6)), Random(3)
litter = [bytearray(Random(n).randrange(1, 9999)) for n in range(SIZE)]
for n in range(3000):
    if n % 40 == 0:
        wanted = [Twist(chance.uniform(-0.3, 1.0), chance.uniform(-2.0, 2.0)) for _ in world.poses]
    for touch in world.step(wanted):
        print(n, touch)
print(world.poses, world.moved())
"""


def test_a_crowd_that_collides_moves_the_same_in_every_process() -> None:
    printed = {
        subprocess.run(
            [sys.executable, "-c", CROWD.replace("SIZE", size)],
            capture_output=True,
            text=True,
            check=True,
            env={"PYTHONHASHSEED": size},
        ).stdout
        for size in ("1", "200", "5000")
    }
    assert len(printed) == 1
    assert printed.pop().count("Touch") > 10


@pytest.mark.parametrize(("theta", "touches"), [(0.0, 0), (pi / 2, 1)])
def test_a_rectangle_touches_a_wall_beside_it_only_with_its_long_side(theta: float, touches: int) -> None:
    corners = "[[0.254,0.215],[-0.254,0.215],[-0.254,-0.215],[0.254,-0.215]]"
    world = bodies("mission.radius_m=0.333", f"world.body.footprint_m={corners}", "mission.formation.separation_m=1")
    assert isinstance(world, Physics)
    world.set_down(9, Obstacle((0.0, 1.0), corners_m=((-2.0, -0.1), (2.0, -0.1), (2.0, 0.1), (-2.0, 0.1))))
    world.place(0, Pose2D(0.0, 0.9 - 0.235, theta))
    assert len(drive(world, STILL, 0.1)) == touches
