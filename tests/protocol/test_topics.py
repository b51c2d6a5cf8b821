"""The table of topics holds what the rest of the project reads from it."""

import pytest

from lfa.agents.agent import Agent
from lfa.protocol.messages.codec import encode
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import Ask
from lfa.protocol.mission import Leading, Mission
from lfa.protocol.names import robot_id_of, robot_name
from lfa.protocol.topics import HARDWARE, TOPIC, TOPICS, TRUTH_OWNER, address, alive_key, key, matches, message_in
from lfa.protocol.transport.bus import Arrival
from lfa.protocol.transport.message_bus import Decoder


def test_each_topic_is_named_once_and_has_its_own_type() -> None:
    assert len(TOPIC) == len(TOPICS) == len({topic.type for topic in TOPICS})


def test_no_agent_hears_ground_truth() -> None:
    agent = Agent(2, 1, "f", 1, Mission(leading=Leading(route_m=((0.0, 0.0), (5.0, 0.0)))))
    before = agent.interests
    agent.tick(0.0)
    for expression in before | agent.interests:
        assert not any(matches(expression, key("f", TRUTH_OWNER, topic)) for topic in ("truth", "clock")), expression


def test_of_what_the_world_says_an_agent_hears_its_own_sensors_and_the_mission_alone() -> None:
    """Every row of the table that hardware or the world may publish, under every owner that there is."""
    agent = Agent(2, 1, "f", 1, Mission(leading=Leading(route_m=((0.0, 0.0), (5.0, 0.0)))))
    agent.tick(0.0)
    of_world = [topic.name for topic in TOPICS if {"driver", "world"} & set(topic.publishers)]
    owners = [TRUTH_OWNER, "world", *(robot_name(robot) for robot in (1, 2, 3, 4))]
    heard = {(owner, topic) for owner in owners for topic in of_world
             if any(matches(expression, key("f", owner, topic)) for expression in agent.interests)}  # fmt: skip
    assert {topic for _, topic in heard} <= {"mission", "lease", "ask", *HARDWARE}, (
        "ask: a driver asks for its mission as well"
    )
    assert {owner for owner, topic in heard if topic in HARDWARE} == {"robot2"}


def test_address_reads_what_key_writes() -> None:
    where = address(key("f", "robot2", "lease", "all"))
    assert where is not None
    assert (where.fleet, where.owner, where.topic, where.to) == ("f", "robot2", "lease", "all")
    alive = address(alive_key("f", "robot2", 17))
    assert alive is not None
    assert alive.to == "17"


@pytest.mark.parametrize(
    "foreign", ["", "x", "lfa/f/robot1", "ros/f/robot1/pose", "lfa/f/robot1/nothing", "lfa/a/b/c/d/e"]
)
def test_keys_that_are_not_ours_have_no_address(foreign: str) -> None:
    assert address(foreign) is None


@pytest.mark.parametrize(
    ("expression", "key", "yes"),
    [
        ("lfa/f/*/pose", "lfa/f/robot1/pose", True),
        ("lfa/f/*/pose", "lfa/g/robot1/pose", False),
        ("lfa/f/*/pose", "lfa/f/robot1/pose/x", False),
        ("lfa/f/**", "lfa/f/robot1/lease/all", True),
        ("lfa/f/*/alive/*", "lfa/f/robot1/alive/3", True),
        ("lfa/f/*/alive/*", "lfa/f/robot1/alive", False),
    ],
)
def test_key_expressions_match_as_zenoh_does(expression: str, key: str, yes: bool) -> None:
    assert matches(expression, key) is yes


def test_names_and_ids_say_the_same() -> None:
    assert [robot_id_of(robot_name(i)) for i in (0, 1, 42)] == [0, 1, 42]
    assert [robot_id_of(n) for n in ("robot", "robot01", "world", "robot-1", "robotx")] == [None] * 5


def test_a_strangers_name_is_no_id_whatever_its_digits() -> None:
    assert [robot_id_of(f"robot{digits}") for digits in ("9" * 5000, "9" * 19, "\u0663", "\u00b2")] == [None] * 4


def test_what_is_no_message_of_its_keys_topic_is_dropped_and_counted() -> None:
    ask = encode(Ask(Header("robot1", 1, 0, 0.0), "mission"))
    arrivals = [Arrival(0.0, key, payload) for key, payload in (
        ("lfa/f/robot1/ask", ask), ("lfa/f/robot1/ask", b"noise"), ("lfa/f/robot1/nothing", ask), ("elsewhere", ask),
    )]  # fmt: skip
    decoder = Decoder()
    assert [message for _, message in decoder.messages(arrivals)] == [message_in("lfa/f/robot1/ask", ask)]
    assert decoder.undecodable == 3
