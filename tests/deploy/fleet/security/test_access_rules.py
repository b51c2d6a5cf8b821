"""Access rules of a secure router: who may say what, and what a member may follow."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from lfa.agents.agent import Agent
from lfa.agents.subscriptions import with_mission
from lfa.deploy.fleet.security import keys
from lfa.deploy.fleet.security.access_rules import KeyPlan, rules, sayable
from lfa.deploy.fleet.security.follow_rights import followable
from lfa.deploy.robot.base import SimulatedBase
from lfa.deploy.robot.driver import Driver
from lfa.protocol.geometry import Pose2D
from lfa.protocol.node import Node
from lfa.protocol.runtime.namesakes import said_by
from lfa.protocol.topics import TOPICS, Topic, matches
from lfa.protocol.transport.spelling import respelled
from lfa.protocol.witness import Witness

SPEAKS = {
    "robot1": {"agent"},
    "world": {"world", "witness", "driver"},
    "driver3": {"driver"},
    "operator": {"operator"},
    "host-a": {"host"},
    "recorder": set(),
}


def plan(robots: int = 3, **more: Any) -> KeyPlan:
    return keys.spread("f", {"a": ("10.0.0.1",), "b": ()}, range(1, robots + 1), **more)


def may(name: str, key: str, within: KeyPlan) -> bool:
    return any(matches(said, key) for said in sayable(name, within))


@pytest.mark.parametrize("topic", TOPICS, ids=lambda topic: topic.name)
@pytest.mark.parametrize("name", SPEAKS)
def test_a_topic_may_be_said_by_its_publishers_and_by_nobody_else(name: str, topic: Topic) -> None:
    said = any(key.split("/")[3] == topic.name for key in sayable(name, plan(drivers=[3])))
    assert said == bool(SPEAKS[name] & set(topic.publishers))


@pytest.mark.parametrize(
    ("name", "key", "allowed"),
    [
        ("robot1", "lfa/f/robot1/cmd_vel", True),
        ("robot1", "lfa/f/robot2/cmd_vel", False),
        ("robot1", "lfa/f/robot1/lease/gateway2", True),
        ("robot1", "lfa/f/robot1/sensors", False),
        ("robot1", "lfa/other/robot1/pose", False),
        ("robot1", "lfa/f/robot1/alive/7", True),
        ("robot1", "lfa/f/sim/truth", False),
        ("world", "lfa/f/robot1/sensors", True),
        ("world", "lfa/f/robot3/sensors", False),
        ("world", "lfa/f/robot1/cmd_vel", False),
        ("world", "lfa/f/sim/truth", True),
        ("world", "lfa/f/witness/lease/robot1", True),
        ("driver3", "lfa/f/robot3/sensors", True),
        ("driver3", "lfa/f/robot3/lease/all", True),
        ("driver3", "lfa/f/robot3/lease/robot1", False),
        ("driver3", "lfa/f/robot3/pose", False),
        ("driver3", "lfa/f/driver3/status", True),
        ("operator", "lfa/f/operator/operator", True),
        ("operator", "lfa/f/robot1/cmd_vel", False),
    ],
)
def test_one_speaks_under_its_own_name(name: str, key: str, allowed: bool) -> None:
    assert may(name, key, plan(drivers=[3])) == allowed


def test_a_recorder_says_nothing() -> None:
    assert sayable("recorder", plan()) == []


def test_a_router_admits_from_a_neighbour_only_who_may_join_there() -> None:
    within = plan(places={"robot1": ["a"], "robot2": ["b"], "robot3": ["b", "a"], "world": ["a"]})
    guard = rules(within, "a", {name: name for name in (*within.places, "host-a", "host-b")})["access_control"]
    said = {rule["id"]: rule["key_exprs"] for rule in guard["rules"]}
    assert "lfa/f/robot2/pose" in said["say-host-b"] and "lfa/f/robot3/pose" in said["say-host-b"]
    assert not [key for key in said["say-host-b"] if "robot1" in key or "world" in key or "sim" in key]
    assert "say-robot3" in said and "say-robot2" not in said, "robot 3 may fail over to a, robot 2 may not"


def test_every_rule_is_for_somebody_and_every_subject_has_rules() -> None:
    guard = rules(plan(), "a", {name: name for name in (*plan().places, "host-a", "host-b")})["access_control"]
    used = {rule for policy in guard["policies"] for rule in policy["rules"]}
    assert used == {rule["id"] for rule in guard["rules"]}
    assert {s for policy in guard["policies"] for s in policy["subjects"]} == {s["id"] for s in guard["subjects"]}
    assert all(rule["permission"] == "allow" for rule in guard["rules"])
    assert guard["enabled"] and guard["default_permission"] == "deny"


def test_whatever_a_member_declares_at_its_router_is_of_listed_keys_and_answers_no_queries() -> None:
    guard = rules(plan(), "a", {name: name for name in (*plan().places, "host-a", "host-b")})["access_control"]
    inwards = [rule for rule in guard["rules"] if "ingress" in rule["flows"]]
    assert not [rule for rule in inwards if "declare_queryable" in rule["messages"]]
    seen = [rule["key_exprs"] for rule in inwards if "declare_liveliness_subscriber" in rule["messages"]]
    assert seen == [["lfa/f/*/alive/*"]]
    said = {key for rule in inwards if "liveliness_token" in rule["messages"] for key in rule["key_exprs"]}
    assert {key.split("/")[2] for key in said if "/alive/" in key} <= {*plan().places, "witness"}


WITHIN = plan(drivers=[3], places={name: ["a"] for name in ("robot1", "robot3", "driver3", "witness", "world")})
NODES: dict[str, Callable[[], Node]] = {
    "robot1": lambda: Agent(1, 9, "f", 0),
    "driver3": lambda: Driver("f", 3, 9, lambda limits, now: SimulatedBase(Pose2D(), limits, now)),
    "witness": lambda: Witness("f", 9, 0),
}


@pytest.mark.parametrize("name", NODES)
def test_a_member_may_follow_what_its_node_follows_and_find_namesakes(name: str) -> None:
    listed = followable(name, "f", WITHIN.robots())
    assert listed is not None
    wanted = {one for one in NODES[name]().interests if "/alive/" not in one} | said_by("f", name)
    assert wanted <= set(listed)
    spelled = {respelled(one, name, turn) for one in wanted for turn in range(9)}
    assert spelled <= set(listed), "a member that declares anew would hear nothing more"


def test_a_robot_may_follow_whomever_it_is_behind() -> None:
    listed = followable("robot1", "f", WITHIN.robots())
    assert listed is not None
    for ahead in (None, 2, 3):
        assert {one for one in with_mission("f", "robot1", ahead, asks=True) if "/alive/" not in one} <= set(listed)


@pytest.mark.parametrize("name", NODES)
def test_what_a_member_may_follow_is_a_list_that_other_spellings_do_not_widen(name: str) -> None:
    """Only the owner may be a wildcard: `lfa/f/robot3/**` would admit a family of names below it."""
    guard = rules(WITHIN, "a", {one: one for one in (*WITHIN.places, "host-a")})["access_control"]
    policies = [policy for policy in guard["policies"] if f"hear-{name}" in policy["rules"]]
    asking = {r["id"]: r["key_exprs"] for r in guard["rules"] if "declare_subscriber" in r["messages"]}
    admitted = [one for p in policies for rule in p["rules"] if rule != "learn" for one in asking.get(rule, [])]
    assert 0 < len(admitted) < 400
    assert not [one for one in admitted if one.split("/")[-1].endswith("*") or "**" in one]
    assert not [one for one in admitted if "*" in one.split("/")[2] and one.split("/")[2] != "*"]
