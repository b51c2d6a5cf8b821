"""`lfa why`: an operator's orders are roots, each once, however often they were repeated."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest
from msgspec import structs

from lfa.deploy.analysis.causes import effects, orders, rules
from lfa.deploy.analysis.causes.fact import Fact
from lfa.deploy.recording.recorder import Recorder
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.consensus import Term
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.orders import OrderNote, TeamOrder
from lfa.protocol.messages.stop import StopOrder, StopWord
from lfa.protocol.messages.team import OperatorNote
from lfa.protocol.mission import Mission

MISSION = Mission(robots=(1, 2, 3))
FIRST = TeamOrder(MISSION.leading, MISSION.formation)


Said = list[tuple[float, str, Message]]
"""Time [s], topic and content of each message."""


def header(seq: int, sender: str = "operator") -> Header:
    return Header(sender, 1, seq, 0.0)


def ordered(folder: Path, said: Said, mission: Mission = MISSION) -> list[tuple[float, str]]:
    """Return times [s] and words of the orders found in a recording of what was `said`."""
    folder.mkdir(exist_ok=True)
    recorder = Recorder(folder, {})
    for at_s, topic, message in said:
        recorder.record(at_s, f"lfa/f/{message.header.sender}/{topic}", message)
    recorder.close()
    return [(fact.at_s, fact.text.removeprefix("an operator ordered: ")) for fact in orders.facts(folder, mission)]


def test_changes_of_the_mission_are_orders_each_once_and_what_the_leader_repeats_is_none(tmp_path: Path) -> None:
    pause = structs.replace(FIRST, version=1, paused=True)
    slow = structs.replace(pause, version=2, leading=structs.replace(FIRST.leading, cruise_mps=0.25))
    go = structs.replace(slow, version=3, paused=False)
    goal = structs.replace(go, version=4, leading=structs.replace(go.leading, route_m=((3.0, -1.5),)))
    said: Said = [(0.0, "team_order", OrderNote(header(0, "robot1"), FIRST, Term(1, 1, 1)))]
    for n, (before, order) in enumerate(pairwise((FIRST, pause, slow, go, goal)), start=1):
        said += [
            (n + 0.0, "team_order", OrderNote(header(2 * n), order)),
            (n + 0.1, "team_order", OrderNote(header(n, "robot1"), before, Term(1, 1, 1))),
            (n + 0.2, "team_order", OrderNote(header(2 * n + 1), order)),
        ]
    assert ordered(tmp_path, said) == [(1.0, "pause"), (2.0, "set cruise_mps=0.25"), (3.0, "go"), (4.0, "go 3 -1.5")]


def test_a_call_to_retire_is_one_order_that_names_the_robot_however_often_it_is_said(tmp_path: Path) -> None:
    call = OperatorNote(header(1), "retire", {"robot": 3, "slot_of": 0})
    again = structs.replace(call, header=header(2))
    assert ordered(tmp_path, [(1.0, "operator", call), (1.2, "operator", again)]) == [(1.0, "retire robot 3")]


def test_e31_a_time_without_an_operator_is_named_only_where_the_mission_needs_one(tmp_path: Path) -> None:
    said: Said = [(at_s, "stop", StopOrder(header(n), None)) for n, at_s in enumerate((0.0, 1.5, 5.0))]
    assert ordered(tmp_path / "none", said) == []
    needs = structs.replace(MISSION, operator_timeout_s=2.0)
    silence = "no operator had been heard for 2 s"
    assert ordered(tmp_path / "needs", said, needs) == [(3.5, silence), (7.0, silence)]


def test_orders_are_roots_each_once_and_simulated_faults_are_none(tmp_path: Path) -> None:
    said: list[tuple[str, Message]] = [
        ("operator", OperatorNote(header(1), "handover")),
        ("operator", OperatorNote(header(2), "weather", {"heal": True})),
        ("stop", StopOrder(header(1), StopWord(1, stand=True))),
        ("stop", StopOrder(header(2), StopWord(1, stand=True))),
        ("stop", StopOrder(header(3), None)),
        ("stop", StopOrder(header(4), StopWord(2, stand=False))),
    ]
    recorder = Recorder(tmp_path, {})
    for n, (topic, message) in enumerate(said):
        recorder.record(float(n), f"lfa/f/operator/{topic}", message)
    recorder.close()
    found = [(fact.at_s, fact.other, fact.evidence) for fact in orders.facts(tmp_path, MISSION)]
    assert found == [
        (0.0, "handover", "operator 1 of operator"),
        (2.0, "stop", "stop 1 of operator"),
        (5.0, "resume", "stop 4 of operator"),
    ]


@pytest.mark.parametrize(("word", "explained"), [("pause", True), ("stop", True), ("go", False), ("resume", False)])
def test_an_order_explains_a_stop_unless_it_lets_robots_go(word: str, explained: bool) -> None:
    order = Fact(4.0, "order", "operator", word, other=word)
    chain = rules.explain(Fact(4.5, "stop", "robot1", "robot 1 stood for 2.0 s"), [order])
    assert (chain.root == order) is explained


def test_a_robot_that_retires_waits_out_of_the_chain_and_for_no_leader() -> None:
    lines = [
        {"t": 1.0, "kind": "role", "robot": 1, "role": "follower"},
        {"t": 2.0, "kind": "chain", "robot": 2, "chain": [2, 3]},
        {"t": 2.0, "kind": "role", "robot": 1, "role": "waiting"},
    ]
    (wait,) = effects._leases(lines)
    assert wait.text == "robot 1 waited, out of the chain"
    order = Fact(1.9, "order", "robot1", "an operator ordered: retire robot 1", other="retire")
    assert rules.explain(wait, [order]).root == order
