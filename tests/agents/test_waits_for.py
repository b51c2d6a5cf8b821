"""An agent says what it waits for: first its mission, then the robots of its team, then nothing."""

from __future__ import annotations

from lfa.agents.agent import Agent
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import MissionNote
from lfa.protocol.mission import Leading, Mission
from lfa.protocol.node import Received, waits_for

MISSION = Mission(robots=(1, 2), leading=Leading(route_m=((1.0, 0.0),)))


def test_an_agent_names_the_mission_and_then_the_missing_robots() -> None:
    agent = Agent(1, 1, "hand", 1)
    assert waits_for(agent) == "the mission, which lfa-world publishes in fleet hand"
    note = MissionNote(Header("world", 1, 0, 0.0), MISSION)
    agent.receive(Received(0.0, "lfa/hand/world/mission", note))
    assert waits_for(agent) == "robot2, witness"
