"""Whose messages and tokens a robot refuses is told: once as an event, and in its status while it goes on."""

from __future__ import annotations

from lfa.agents.agent import Agent
from lfa.agents.input_watch import TOLD_S
from lfa.protocol.messages.team import REFUSED_OF, Event, Status
from lfa.protocol.mission import Leading, Mission
from lfa.protocol.node import Received, Vitals

MISSION = Mission((1, 2, 3), leading=Leading(route_m=((0.0, 0.0), (5.0, 0.0))))


def told(*refused: tuple[int, int]) -> list[tuple[list[object], str]]:
    """Return the events and the status text of each second in which `refused` (the second, the number) holds."""
    agent = Agent(2, 1, "f", 1, MISSION)
    agent.tick(0.0)
    said = []
    for second, number in refused:
        vitals = Vitals(0.0, number, 0, 0.0, 0.0, 0.0, (("robot3", number),) if number else ())
        messages = [sent.message for sent in agent.receive(Received(float(second), "", vitals))]
        events = [m.data for m in messages if isinstance(m, Event) and m.kind == "excess"]
        said.append((events, next(m.text for m in messages if isinstance(m, Status))))
    return said


def test_a_member_that_says_more_than_is_taken_is_told_once_and_seen_in_each_status() -> None:
    first, *later = told((1, 500), (2, 900), (3, 1400))
    assert first[0] == [{"member": "robot3", "refused": 500}]
    assert [events for events, _ in later] == [[], []]
    assert later[-1][1].endswith("1400 messages or tokens of robot3 refused")


def test_a_member_that_was_quiet_meanwhile_is_told_again() -> None:
    again = told((1, 500), (2, 500), (2 + int(TOLD_S), 500), (20, 501))
    assert [len(events) for events, _ in again] == [1, 0, 0, 1]
    assert "refused" in again[1][1]
    assert "refused" not in again[2][1]


def test_a_status_counts_what_was_refused_of_each_member() -> None:
    agent = Agent(2, 1, "f", 1, MISSION)
    agent.tick(0.0)
    vitals = Vitals(0.0, 9, 0, 0.0, 0.0, 0.0, (("robot3", 7), ("operator", 2)))
    status = next(sent.message for sent in agent.receive(Received(1.0, "", vitals)) if isinstance(sent.message, Status))
    counted = {name: n for name, n in status.counters.items() if name.startswith(REFUSED_OF)}
    assert counted == {"refused_of_robot3": 7, "refused_of_operator": 2}


def test_without_refusals_nothing_is_told() -> None:
    assert all(not events and "refused" not in text for events, text in told((1, 0), (2, 0)))
