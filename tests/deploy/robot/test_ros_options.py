"""Which ROS robot a driver is told of, and what the graph shows of it: found, or refused in one line."""

from __future__ import annotations

from typing import Any

import pytest
from msgspec import structs

from lfa.deploy.robot.ros_open import RosOptions, RosRobot, check_place, check_sources, listeners, only
from lfa.deploy.robot.ros_presets import PRESETS, RosPreset, load_preset
from lfa.deploy.ros.graph import RosGraph
from lfa.deploy.ros.types import type_hash
from lfa.deploy.ros.wire import DEFAULT, RosEndpoint, RosNode
from lfa.protocol.errors import Refused

TWIST, STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"


def listening(topic: str, of_type: str = STAMPED, domains: tuple[int, ...] = (0,)) -> RosGraph:
    graph = RosGraph()
    for domain in domains:
        for one in topic.split():
            node = RosNode(domain, "a", 0, "", "base")
            graph.update(RosEndpoint(node, 1, "MS", one, of_type, type_hash(of_type), DEFAULT).token, up=True)
    return graph


@pytest.mark.parametrize(
    ("topics", "namespace", "words"),
    [("/chatter", None, "no node listens to .../cmd_vel on domain 0"),
     ("/a/cmd_vel /b/cmd_vel", None, "--namespace /a or --namespace /b"),
     ("/a/cmd_vel", "/c", "no node listens to /c/cmd_vel")],
)  # fmt: skip
def test_no_robot_and_several_are_refused_in_one_line(topics: str, namespace: str | None, words: str) -> None:
    options = RosOptions("tcp/127.0.0.1:7447", 0, namespace, RosPreset())
    with pytest.raises(Refused) as refused:
        only(listeners(listening(topics), options), options)
    assert words in str(refused.value)


def test_the_domain_is_that_of_the_only_robot_unless_it_is_named() -> None:
    found = listening("/a/cmd_vel", domains=(7,))
    anywhere, elsewhere = (RosOptions("tcp/127.0.0.1:7447", domain, None, RosPreset()) for domain in (None, 3))
    assert only(listeners(found, anywhere), anywhere).node.domain == 7
    assert listeners(found, elsewhere) == []
    twice = listening("/a/cmd_vel", domains=(7, 42))
    with pytest.raises(Refused, match="say --domain 7 or --domain 42"):
        only(listeners(twice, anywhere), anywhere)


def test_a_robot_without_a_namespace_is_found_by_the_name_that_is_said_of_it() -> None:
    found = listening("/cmd_vel /a/cmd_vel")
    anywhere, root = (RosOptions("tcp/127.0.0.1:7447", 0, name, RosPreset()) for name in (None, ""))
    with pytest.raises(Refused, match="say --namespace / or --namespace /a"):
        only(listeners(found, anywhere), anywhere)
    assert only(listeners(found, root), root).topic == "/cmd_vel"


@pytest.mark.parametrize("names", [("base", "base"), ("base", "ekf")])
def test_two_robots_under_one_namespace_are_refused_in_one_line(names: tuple[str, str]) -> None:
    odom, graph = "nav_msgs/msg/Odometry", RosGraph()
    for session, name in zip("ab", names, strict=True):
        node = RosNode(0, session, 0, "/bot", name)
        graph.update(RosEndpoint(node, 1, "MP", "/bot/odom", odom, type_hash(odom), DEFAULT).token, up=True)
    with pytest.raises(Refused, match=r"/bot/odom: published by .*: two robots share a namespace, give each one"):
        check_sources(graph, "/bot/odom")


@pytest.mark.parametrize(
    ("changed", "words"),
    [({"domain": 233}, "--domain 233"), ({"namespace": "/*"}, "--namespace '/\\*'"),
     ({"namespace": "bot"}, "full ROS name"), ({"names": RosPreset(odom="**")}, "--odom"),
     ({"names": RosPreset(cmd_vel="a//b")}, "--cmd-vel")],
)  # fmt: skip
def test_what_is_no_name_of_ros_is_refused_before_anything_is_opened(changed: dict[str, Any], words: str) -> None:
    options = structs.replace(RosOptions("tcp/127.0.0.1:7447", 0, None, RosPreset()), **changed)
    with pytest.raises(Refused, match=words):
        RosRobot(options, None)


def test_a_link_to_another_machine_is_refused_unless_the_robot_stops_by_itself() -> None:
    far = RosOptions("tcp/10.0.0.7:7447", 0, None, RosPreset())
    with pytest.raises(Refused, match="run lfa-driver on the robot"):
        check_place(far)
    check_place(RosOptions("tcp/10.0.0.7:7447", 0, None, RosPreset(), stops_by_itself=True))


@pytest.mark.parametrize("laser", ["[nan, 0.0, 0.0]", "[0.0, inf, 0.0]", "[1e308, 0.0, 0.0]"])
def test_a_scanner_of_a_preset_is_mounted_on_its_robot(laser: str, tmp_path: Any) -> None:
    own = tmp_path / "rover.toml"
    own.write_text(f"laser = {laser}\n")
    with pytest.raises(Refused, match="each at most 100"):
        load_preset(str(own))


def test_a_preset_is_named_or_a_file_of_ones_own(tmp_path: Any) -> None:
    own = tmp_path / "rover.toml"
    own.write_text('odom = "wheel/odom"\nlaser = [0.1, 0.0, 3.14]\n')
    assert load_preset(str(own)) == RosPreset(odom="wheel/odom", laser=(0.1, 0.0, 3.14))
    assert load_preset("clearpath") == PRESETS["clearpath"]
    own.write_text('odo = "x"\n')
    for bad, words in (
        (str(own), "must be TOML with keys odom"),
        ("spot", "one of turtlebot3"),
        ("no.toml", "No such file"),
    ):
        with pytest.raises(Refused, match=words):
            load_preset(bad)
