"""A leader in a dead end that its own team closes: it hands over, the others go on, and it follows at the tail."""

from __future__ import annotations

from math import hypot, inf
from pathlib import Path
from typing import Any, ClassVar

import pytest

from lfa.agents.agent import Agent
from lfa.agents.perception.obstacle_model import TRAP_M
from lfa.deploy.analysis.summary import Summary
from lfa.deploy.recording import event_log
from lfa.deploy.run.simulate import run
from lfa.protocol.geometry import Pose2D
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.simulation import Truth
from lfa.protocol.messages.team import ObstacleNote
from lfa.protocol.node import Envelope, Node, Received
from lfa.protocol.runtime.journal import JOURNAL_VERSION, Heading, Journal
from lfa.protocol.topics import key
from lfa.protocol.witness import Witness
from lfa.world.description.load import load
from lfa.world.simulator import Simulator
from lfa.world.world import World

HANDOVER_S = 10.0
Trapped = tuple[Summary, list[event_log.Line]]


@pytest.fixture(scope="module")
def trapped(tmp_path_factory: pytest.TempPathFactory) -> Trapped:
    ended = run(load("dead_end"), 1, tmp_path_factory.mktemp("trapped") / "run")
    return ended.summary, event_log.lines(ended.folder)


def test_the_trapped_leader_hands_over_within_ten_seconds(trapped: Trapped) -> None:
    summary, events = trapped
    met = next(e["t"] for e in event_log.of_kind(events, "decision") if e["robot"] == 1)
    stuck = next(e for e in event_log.of_kind(events, "stuck") if e["robot"] == 1)
    assert stuck["reason"].startswith("S2"), "lfa sim dead_end --seed 1"
    assert [(reign.robot_id, reign.cause) for reign in summary.leaders] == [(1, "start"), (2, "handed_over")]
    assert summary.leaders[1].from_s - met <= HANDOVER_S


def test_it_is_left_out_while_it_is_stuck_and_comes_in_again_at_the_tail(trapped: Trapped) -> None:
    _, events = trapped
    chains = [e["chain"] for e in event_log.of_kind(events, "chain") if e["robot"] == 2]
    assert [2, 3, 4] in chains
    assert event_log.last_chain(events) == [2, 3, 4, 1]


def test_all_four_reach_the_goal_without_contact(trapped: Trapped) -> None:
    summary, _ = trapped
    assert summary.outcome == "goal_reached", "lfa sim dead_end --seed 1"
    assert summary.left_behind == []
    assert sum(robot.contacts for robot in summary.robots) == 0
    assert summary.violations == []


class Warner:
    """In robot 2's name it warns of the place in which robot 1 starts, as a robot that got stuck there would."""

    name, incarnation, finished, refusal = "robot2", 1, False, None
    started_with: ClassVar[dict[str, Any]] = {}

    def __init__(self, fleet: str, place: Pose2D) -> None:
        self._warning = ObstacleNote(Header(self.name, 1, 1, 0.0), "trap", place.x, place.y, TRAP_M)
        self._key = key(fleet, self.name, "obstacles")
        self.interests = frozenset({self._key})
        self._at = 1.0

    def receive(self, received: Received) -> list[Envelope]:
        return []

    def tick(self, now: float) -> list[Envelope]:
        self._at = inf
        return [Envelope(self._key, self._warning)]

    def next_deadline(self) -> float:
        return self._at


def test_an_explorer_is_not_barred_in_by_a_trap_that_it_is_told_of() -> None:
    scenario = load("explore", ["mission.robots=[1,2]"])
    start, fleet = Pose2D(*scenario.world.starts[0]), "warned"
    simulator = Simulator(scenario.radio, seed=1)
    places: list[Pose2D] = []

    def hear(_now: float, _key: str, _payload: bytes, message: Message) -> None:
        if isinstance(message, Truth):
            places.append(Pose2D(message.robots[0].x, message.robots[0].y, 0.0))

    simulator.taps.append(hear)
    nodes: list[Node] = [World(fleet, scenario, 1, 1, start_at=0.0), Witness(fleet, 1, 1), Agent(1, 1, fleet, 1)]
    for node in (*nodes, Warner(fleet, start)):
        simulator.add(node, Journal(None, Heading(JOURNAL_VERSION, node.name, 1, 1, {})))
    simulator.run(12.0)
    assert hypot(places[-1].x - start.x, places[-1].y - start.y) > TRAP_M


def test_a_leader_gets_past_a_splinter_that_one_beam_in_a_few_scans_meets(tmp_path: Path) -> None:
    """A scan that does not show it must not end the detour beside it: the leader stood before it, and touched it."""
    thing = "world.obstacles=[{center_m=[4.0,0.0], corners_m=[[0,0],[0.005,0],[0.005,0.005]]}]"
    short = ("mission.leading.route_m=[[8.0,0.0]]", "time_limit_s=90.0", "mission.leading.cruise_mps=0.5")
    summary = run(load("straight", (thing, *short), robots=1), 0, tmp_path / "run").summary
    assert (summary.outcome, summary.robots[0].contacts) == ("goal_reached", 0), summary.reason
