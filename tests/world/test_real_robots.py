"""A robot with hardware of its own in a simulated world: seen and met by others, moved as it says, not spoken for."""

from __future__ import annotations

import pytest

from lfa.protocol.errors import Refused
from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.messages.consensus import NO_TERM, GatewayStamp
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import Localization, Sensors
from lfa.protocol.messages.simulation import Truth
from lfa.protocol.node import Envelope, Received
from lfa.world.description.load import draw, load
from lfa.world.physics.kinematics import Kinematic
from lfa.world.physics.rigid_bodies import Physics
from lfa.world.world import World

SETTINGS = ["mission.cold_start=full_house", "world.real_robots=[2]"]


def world(bodies: type[Physics] | type[Kinematic] = Physics) -> World:
    return World("f", draw(load("straight", SETTINGS, 3), 0), 0, 1, start_at=0.0, bodies=bodies)


def run(made: World, since: float, until: float) -> list[Envelope]:
    return [envelope for n in range(round((until - since) * 100.0)) for envelope in made.tick(since + n / 100.0)]


def told(made: World, now: float, pose: Pose2D, twist: Twist) -> None:
    header = Header("driver2", 1, 1, 77.0)
    made.receive(Received(now, "lfa/f/robot2/localization", Localization(header, pose)))
    sensors = Sensors(header, pose, twist, 0.0, GatewayStamp(1, 77.0), NO_TERM)
    made.receive(Received(now, "lfa/f/robot2/sensors", sensors))


def test_the_world_says_nothing_in_its_name_and_hears_none_of_its_commands() -> None:
    made = world()
    owners = {envelope.key.split("/")[2] for envelope in run(made, 0.0, 1.0)}
    assert owners == {"robot1", "robot3", "world", "sim"}
    assert not {"lfa/f/robot2/cmd_vel", "lfa/f/*/lease/gateway2", "lfa/f/robot2/alive/*"} & made.interests
    assert {"lfa/f/robot1/cmd_vel", "lfa/f/robot2/localization"} <= made.interests


@pytest.mark.parametrize("bodies", [Physics, Kinematic])
def test_its_body_goes_where_it_says_and_drives_on_when_its_driver_falls_silent(
    bodies: type[Physics] | type[Kinematic],
) -> None:
    made = world(bodies)
    run(made, 0.0, 0.1)
    told(made, 0.1, Pose2D(-3.0, 2.0, 0.0), Twist(0.5, 0.0))
    shown = [envelope.message for envelope in run(made, 0.1, 2.0) if isinstance(envelope.message, Truth)]
    first, last = (next(robot for robot in truth.robots if robot.id == 2) for truth in (shown[0], shown[-1]))
    assert (first.x, first.y) == pytest.approx((-3.0, 2.0), abs=0.02)
    assert last.x > -2.3, "the world hides that a hung driver leaves its wheels turning"


def test_what_a_simulated_robots_driver_would_say_moves_nothing() -> None:
    made = world()
    run(made, 0.0, 0.1)
    fix = Localization(Header("driver1", 1, 1, 0.0), Pose2D(9.0, 9.0, 0.0))
    made.receive(Received(0.1, "lfa/f/robot1/localization", fix))
    truth = [envelope.message for envelope in run(made, 0.1, 0.3) if isinstance(envelope.message, Truth)][-1]
    assert truth.robots[0].x < 1.0


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (["world.real_robots=[7]", "mission.cold_start=full_house"], "ids among"),
        (["world.real_robots=[2]", "mission.cold_start=majority"], "full_house with world.real_robots"),
    ],
)
def test_a_team_that_cannot_be_is_refused(settings: list[str], words: str) -> None:
    with pytest.raises(Refused, match=words):
        draw(load("straight", settings, 3), 0)
