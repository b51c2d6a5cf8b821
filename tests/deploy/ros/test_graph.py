"""The ROS graph as tokens show it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfa.deploy.ros import graph as graphs
from lfa.deploy.ros.graph import TWISTS, RosGraph
from lfa.deploy.ros.types import type_hash
from lfa.deploy.ros.wire import DEFAULT, RosEndpoint, RosNode
from tests.deploy.ros.test_wire import GOLDEN


def _of_genuine_nodes() -> RosGraph:
    graph = RosGraph()
    for token in GOLDEN["tokens"]:
        graph.update(token, up=True)
    return graph


def _twist(kind: str, session: str, topic: str = "/robot3/cmd_vel", stamped: bool = True) -> str:
    name = "geometry_msgs/msg/TwistStamped" if stamped else "geometry_msgs/msg/Twist"
    node = RosNode(0, session, 0, "", "teleop")
    return RosEndpoint(node, 1, kind, topic, name, type_hash(name), DEFAULT).token  # type: ignore[arg-type]


def test_nodes_and_endpoints_of_genuine_nodes_are_listed() -> None:
    graph = _of_genuine_nodes()
    assert sorted(node.full_name for node in graph.nodes()) == ["/golden", "/listener", "/robot3/turtlebot3_node"]
    assert {one.topic for one in graph.endpoints("SS", "/lfa/handover")} == {"/lfa/handover"}
    assert graph.dropped == 0


def test_the_graph_tells_whether_a_robot_wants_twist_or_twist_stamped() -> None:
    graph = _of_genuine_nodes()
    graph.update(_twist("MS", "b", "/cmd_vel", stamped=False), up=True)
    wanted = {one.topic: TWISTS[one.type] for one in graph.endpoints("MS") if one.type in TWISTS}
    assert wanted == {"/robot3/cmd_vel": True, "/cmd_vel": False}


def test_another_publisher_of_a_command_is_seen_until_its_token_vanishes() -> None:
    graph = _of_genuine_nodes()
    teleop = _twist("MP", "b")
    graph.update(teleop, up=True)
    assert graph.publishers("/robot3/cmd_vel") == ["/teleop"]
    graph.update(teleop, up=False)
    assert graph.publishers("/robot3/cmd_vel") == []


def test_two_nodes_of_one_name_are_two_publishers_and_ones_own_are_left_out() -> None:
    """Two robots of one make run nodes of the same name: only their sessions differ."""
    graph = RosGraph()
    for session in ("a", "b", "c"):
        graph.update(_twist("MP", session), up=True)
    assert graph.publishers("/robot3/cmd_vel") == ["/teleop"] * 3
    assert graph.publishers("/robot3/cmd_vel", {"a", "b"}) == ["/teleop"]


def test_nodes_of_humble_are_told_from_newer_ones() -> None:
    graph = RosGraph()
    graph.update(
        _twist("MP", "a").replace(type_hash("geometry_msgs/msg/TwistStamped"), "TypeHashNotSupported"), up=True
    )
    assert graph.hashless() == ["/teleop"]
    assert graph.hashed() == []


@given(st.lists(st.text(max_size=20), max_size=10))
def test_any_key_is_counted_and_dropped(keys: list[str]) -> None:
    graph = RosGraph()
    for key in keys:
        graph.update(key, up=True)
        graph.update(key, up=False)
    assert graph.dropped == len(keys)
    assert graph.nodes() == []


def test_a_flood_of_tokens_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(graphs, "TOKENS_MAX", 10)
    graph = RosGraph()
    for n in range(20):
        graph.update(RosNode(0, "a", n, "", "n").token, up=True)
    assert (len(graph.nodes()), graph.dropped) == (10, 10)
