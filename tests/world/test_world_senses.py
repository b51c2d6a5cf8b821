"""The world as a Node: what it tells of its robots and obstacles."""

from __future__ import annotations

import pytest

from lfa.protocol.geometry import Pose2D, Twist, distance
from lfa.protocol.messages.robot import Contact, GroundProfile, LaserScan, Localization, Sensors
from lfa.protocol.messages.simulation import Clock, Truth
from lfa.world.physics.kinematics import Kinematic
from tests.rigs.world_rig import MOVER, Rig, events, last, of


def test_a_wall_is_felt_once_and_odometry_runs_on_while_the_wheels_slip() -> None:
    rig = Rig("mission.robots=[1]", "world.walls_m=[[1,-3,1,3]]").opened()
    rig.run(6.0, Twist(0.5, 0.0))
    (contact,) = of(rig.said, Contact)
    assert contact.bearing == pytest.approx(0.0, abs=1e-6)
    (event,) = events(rig.said, "contact")
    assert event.data["robot"] == 1
    assert event.data["other"] == "wall0"
    assert event.data["x"] == pytest.approx(1.0, abs=0.01)
    assert 1.5 < event.data["t"] < 3.0
    assert rig.truth().robots[0].x == pytest.approx(0.85, abs=0.005)
    assert last(rig.said, Sensors).pose_odom.x > 2.0


def test_the_contact_is_in_base_link() -> None:
    rig = Rig("mission.robots=[1]", "world.walls_m=[[1,-3,1,3]]", "world.starts=[[0,0,0.5]]").opened()
    rig.run(3.0, Twist(0.5, 0.0))
    assert of(rig.said, Contact)[0].bearing == pytest.approx(-0.5, abs=0.01)


def test_without_noise_a_fix_is_the_true_pose_of_its_stamp() -> None:
    rig = Rig().opened()
    rig.run(3.0, Twist(0.5, 0.3))
    truth = {round(t.header.stamp, 6): t.robots[1] for t in of(rig.said, Truth)}
    for fix in of(rig.said, Localization, "robot2"):
        robot = truth[round(fix.header.stamp, 6)]
        assert fix.pose_map == Pose2D(robot.x, robot.y, robot.theta)


def test_truth_tells_where_moving_obstacles_are() -> None:
    rig = Rig(MOVER)
    rig.run(2.5)
    (obstacle,) = rig.truth().obstacles
    assert (obstacle.index, obstacle.x) == (0, 3.0)
    assert obstacle.y == pytest.approx(0.0, abs=0.01)


def test_without_an_engine_the_world_speaks_the_same() -> None:
    rig, plain = Rig().opened(), Rig(bodies=Kinematic).opened()
    for each in (rig, plain):
        each.run(3.0, Twist(0.5, 0.3))
    assert [e.key for e in rig.said] == [e.key for e in plain.said]
    for a, b in zip(of(rig.said, Truth), of(plain.said, Truth), strict=True):
        assert all(
            distance(Pose2D(p.x, p.y, 0.0), Pose2D(q.x, q.y, 0.0)) < 1e-9
            for p, q in zip(a.robots, b.robots, strict=True)
        )


def test_a_robot_in_a_hole_is_told_so_by_its_own_sensors_alone() -> None:
    """Its wheels turn, its localisation stands, and the floor ahead is a step up; no message says `stuck`."""
    hole = "world.potholes=[{center_m=[0.5,0], width_m=0.4, length_m=2, depth_m=0.07}]"
    rig = Rig("mission.robots=[1]", hole).opened()
    rig.run(4.0, Twist(0.3, 0.0))
    said = rig.run(3.0, Twist(0.3, 0.0))
    sensors, fixes, ground = of(said, Sensors), of(said, Localization), of(said, GroundProfile)
    assert sensors[-1].odometer_m - sensors[0].odometer_m == pytest.approx(0.9, abs=0.01)
    assert sensors[-1].pose_odom.x - sensors[0].pose_odom.x == pytest.approx(0.9, abs=0.01)
    assert {fix.pose_map for fix in fixes} == {fixes[0].pose_map}
    assert 0.3 < fixes[0].pose_map.x < 0.7
    assert {row for profile in ground for row in profile.heights_m} == {(0.07,) * 29}
    assert {type(e.message) for e in said} <= {Sensors, Localization, LaserScan, GroundProfile, Truth, Clock}


def test_the_profile_of_a_robot_shows_the_hole_where_it_comes_to_it() -> None:
    hole = "world.potholes=[{center_m=[1.0,0], width_m=0.28, length_m=2, depth_m=0.07}]"
    rig = Rig("mission.robots=[1]", hole).opened()
    for profile in of(rig.run(0.5), GroundProfile):
        points = [profile.first_m + j * profile.increment_m for j in range(29)]
        for row in profile.heights_m:
            seen = [x for x, height in zip(points, row, strict=True) if height == -0.07]
            assert seen == [x for x in points if 0.86 <= x <= 1.14]
