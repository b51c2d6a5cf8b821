"""An agent has two phases: it asks for its mission, and with one that names it, it takes part."""

from __future__ import annotations

from msgspec.structs import replace

from lfa.agents.agent import ASK_S, Agent
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import Ask, Event, MissionNote, Status
from lfa.protocol.mission import Leading, Mission
from lfa.protocol.node import Received, Stop, Vitals

MISSION = Mission((1, 2, 3), leading=Leading(route_m=((0.0, 0.0), (5.0, 0.0))))
VITALS = Received(0.1, "", Vitals(0.0, 0, 0, 0.0, 0.0))


def note(mission: Mission) -> Received:
    return Received(0.2, "lfa/f/world/mission", MissionNote(Header("world", 1, 0, 0.2), mission))


def test_before_its_mission_an_agent_asks_twice_a_second_and_says_that_it_waits() -> None:
    agent = Agent(2, 1, "f", 1)
    assert [type(sent.message) for sent in agent.tick(0.0)] == [Ask]
    assert agent.tick(0.9 * ASK_S) == []
    assert [type(sent.message) for sent in agent.tick(ASK_S)] == [Ask]
    [status] = [sent.message for sent in agent.receive(VITALS)]
    assert isinstance(status, Status) and status.text == "waiting for the mission"
    assert agent.core is None and agent.lease is None and not agent.defer_grants


def test_with_its_mission_an_agent_has_a_lease_and_hears_its_team() -> None:
    agent = Agent(2, 1, "f", 1)
    waiting = agent.interests
    [event] = [sent.message for sent in agent.receive(note(MISSION))]
    assert isinstance(event, Event) and event.kind == "mission"
    assert agent.lease is not None and agent.lease.me.id == 2
    assert waiting < agent.interests
    assert {"lfa/f/*/lease/all", "lfa/f/*/lease/hello", "lfa/f/*/lease/robot2"} <= agent.interests


def test_a_second_mission_changes_nothing() -> None:
    agent = Agent(2, 1, "f", 1)
    agent.receive(note(MISSION))
    core = agent.core
    assert agent.receive(note(replace(MISSION, robots=(2, 3)))) == []
    assert agent.core is core


def test_a_mission_without_this_robot_is_refused_and_says_which_it_has() -> None:
    agent = Agent(7, 1, "f", 1)
    assert agent.receive(note(MISSION)) == []
    assert agent.refusal == "id 7: not in the mission, which has robots [1, 2, 3]"
    assert agent.core is None


def test_an_agent_that_is_stopped_before_its_mission_has_finished_at_once() -> None:
    agent = Agent(2, 1, "f", 1)
    assert not agent.finished
    assert agent.receive(Received(0.3, "", Stop())) == []
    assert agent.finished


def test_an_agent_that_holds_no_lease_has_finished_as_soon_as_it_is_stopped() -> None:
    agent = Agent(2, 1, "f", 1, MISSION)
    agent.tick(0.0)
    assert not agent.finished
    agent.receive(Received(0.3, "", Stop()))
    assert agent.finished
