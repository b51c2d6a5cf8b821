"""A ROS robot of any domain and distribution is found in the graph; its driver sees who else commands it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import Any

import pytest

from lfa.deploy.robot.ros_open import DRIVER_NODE, GRAPH_S, RosOptions, RosRobot, two_sources
from lfa.deploy.robot.ros_presets import PRESETS
from lfa.deploy.ros.session import RosSpace
from lfa.deploy.ros.wire import Distro
from lfa.protocol import clock
from lfa.protocol.geometry import Twist
from lfa.protocol.mission import Limits
from lfa.protocol.transport.bus import Wake
from lfa.protocol.transport.zenoh_ros import ros_session
from tests.rigs.ros_peers import awaited, free_endpoint, ros_client

pytestmark = pytest.mark.processes
STAMPED, ODOM = "geometry_msgs/msg/TwistStamped", "nav_msgs/msg/Odometry"


class Bot:
    """A robot's node `/bot/base`, which takes commands and publishes odometry, at a router of its own."""

    def __init__(self, endpoint: str, theirs: RosSpace) -> None:
        self.endpoint = endpoint
        node = theirs.node("base", "/bot")
        self.commands = node.subscription("/bot/cmd_vel", STAMPED)
        node.publisher("/bot/odom", ODOM)

    def found(self) -> RosRobot:
        return RosRobot(RosOptions(self.endpoint, None, None, PRESETS["turtlebot3"]), None)


@contextmanager
def bot(domain: int, distro: Distro) -> Iterator[Bot]:
    endpoint = free_endpoint()
    with closing(ros_session(endpoint, serve=True)), closing(ros_session(endpoint, serve=False)) as session:
        yield Bot(endpoint, RosSpace(session, domain, distro, Wake()))


@pytest.mark.parametrize(("domain", "distro"), [(0, "jazzy"), (42, "humble")])
def test_a_robot_of_any_domain_and_distribution_is_found_and_driven(
    domain: int, distro: Distro, capfd: pytest.CaptureFixture[str]
) -> None:
    with bot(domain, distro) as robot, closing(robot.found()) as driver:
        base = driver.make_base(Limits(), clock.now())

        def heard() -> Any:
            base.drive(Twist(0.25, 0.0), clock.now())
            return robot.commands.take()

        assert awaited(heard, "the command arrives")[0].twist.linear.x == 0.25
    assert f"drives /bot/base by TwistStamped on /bot/cmd_vel, domain {domain}" in capfd.readouterr().out


def test_a_second_driver_and_a_second_robot_of_the_same_names_are_one_line_each(
    capfd: pytest.CaptureFixture[str],
) -> None:
    with bot(0, "jazzy") as robot, closing(robot.found()) as driver:
        base = driver.make_base(Limits(), clock.now())
        base.drive(Twist(), clock.now())
        driver.alive(clock.now())
        assert capfd.readouterr().err == "", "its own watchdog is no second commander"
        with ros_client(robot.endpoint) as other:
            other.node(DRIVER_NODE, "/bot").publisher("/bot/cmd_vel", STAMPED)
            other.node("base", "/bot").publisher("/bot/odom", ODOM)
            told: list[str] = []

            def both() -> bool:
                driver.alive(clock.now() + (len(told) + 1) * GRAPH_S)
                told.extend(capfd.readouterr().err.splitlines())
                return len(told) >= 2

            awaited(both, "both warnings")
            for later in range(5):
                driver.alive(clock.now() + later * GRAPH_S)
            told.extend(capfd.readouterr().err.splitlines())
    assert sorted(told) == [
        "lfa-driver: /bot/lfa_driver publishes on /bot/cmd_vel too: two commanders, stop one",
        f"lfa-driver: /bot/odom: {two_sources(['/bot/base', '/bot/base'])}",
    ]
