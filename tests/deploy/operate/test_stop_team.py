"""The fleet stop of whole agents and a world in virtual time: E28 to E31, and I10 while processes die and restart."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from msgspec import structs

from lfa.deploy.client.stop_call import StopOutcome
from lfa.deploy.client.stop_node import StopNode
from lfa.deploy.fuzz.agent_simulation import FLEET, AgentSimulation
from lfa.deploy.fuzz.network import FAIR
from lfa.deploy.fuzz.schedules import draw
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.simulation import Truth
from lfa.protocol.runtime.journal import JOURNAL_VERSION, Heading, Journal

DRIVING_S = 4.0
"""All four drive at cruising speed by then."""
LATE_S = 0.06
REST_MPS = 1e-6


class Stopped:
    """A team of four that drives, and the operator who stops it."""

    def __init__(self) -> None:
        schedule = structs.replace(
            draw(0), robots=4, profile="std", witness=True, rates={}, faults=(), spares=(), radio=FAIR
        )
        self.team = AgentSimulation(schedule)
        self.speeds: dict[int, list[tuple[float, float]]] = {}
        """Of each robot, time [s] and speed [m/s]."""
        self.team.simulator.taps.append(self._hear)
        self._calls = 0
        self.team.start_all()
        self.team.run(DRIVING_S)

    def _hear(self, now: float, _key: str, _payload: bytes, message: Message) -> None:
        if isinstance(message, Truth):
            for robot in message.robots:
                self.speeds.setdefault(robot.id, []).append((now, abs(robot.linear_x)))

    def say(self, *, stand: bool, during: Callable[[], None] = lambda: None) -> StopNode:
        """Say stop or resume, with `during` right after the first word, and run until the call is over."""
        self._calls += 1
        node = StopNode(FLEET, f"operator{self._calls}", self._calls, self.team.mission.robots, stand=stand)
        heading = Heading(JOURNAL_VERSION, node.name, node.incarnation, 1, {})
        self.team.simulator.add(node, Journal(None, heading))
        self.team.run(self.team.now + 0.001)
        during()
        while not node.finished:
            self.team.run(self.team.now + 0.01)
        return node

    def stop(self, during: Callable[[], None] = lambda: None) -> StopOutcome:
        outcome = self.say(stand=True, during=during).outcome
        assert outcome is not None
        return outcome

    def run(self, for_s: float) -> Stopped:
        self.team.run(self.team.now + for_s)
        return self

    def moved_since(self, since: float) -> set[int]:
        """The robots that have moved after `since` [s]."""
        return {robot for robot, told in self.speeds.items() if any(at > since and v > REST_MPS for at, v in told)}

    def drives(self) -> bool:
        """All robots drive at this moment."""
        return all(told[-1][1] > 0.1 for told in self.speeds.values())


def test_e28_from_the_word_to_the_last_wheel_takes_no_longer_than_braking() -> None:
    scene = Stopped()
    said_at, speed = scene.team.now, max(told[-1][1] for told in scene.speeds.values())
    outcome = scene.stop()
    rest_s = scene.run(0.5).team.mission.limits
    assert outcome.complete and outcome.done == (1, 2, 3, 4)
    assert scene.moved_since(said_at + speed / rest_s.a_max_mps2 + LATE_S) == set()
    assert scene.run(3.0).moved_since(said_at + 1.5) == set(), "and it lasts"


def test_a_resumed_team_goes_on_with_its_leader_and_its_chain() -> None:
    scene = Stopped()
    led = scene.team.leaders()
    assert scene.stop().complete
    outcome = scene.run(5.0).say(stand=False).outcome
    assert outcome is not None and outcome.complete
    assert scene.run(3.0).drives()
    assert scene.team.leaders() == led, "nobody was stuck meanwhile"


def test_the_leaders_death_at_the_moment_of_the_word_changes_nothing() -> None:
    scene = Stopped()
    said_at = scene.team.now
    assert scene.stop(during=lambda: scene.team.kill(scene.team.leaders()[0])).complete
    assert scene.run(3.0).moved_since(said_at + 1.5) == set()
    assert scene.team.leaders() not in ([], [1]), "there is a new leader, which stands"


def test_i10_gateways_that_restart_stay_stopped_because_their_agents_know() -> None:
    scene = Stopped()
    said_at = scene.team.now
    assert scene.stop().complete
    scene.team.kill_gateway(1)
    scene.run(0.2).team.start_gateway(1)
    assert scene.run(3.0).moved_since(said_at + 1.5) == set()
    outcome = scene.say(stand=False).outcome
    assert outcome is not None and outcome.complete
    assert scene.run(4.0).drives()


def test_i10_agents_that_restart_stay_stopped_because_their_gateways_know() -> None:
    scene = Stopped()
    said_at = scene.team.now
    assert scene.stop().complete
    for robot in scene.team.mission.robots:
        scene.team.start(robot)
    assert scene.run(4.0).moved_since(said_at + 1.5) == set()


def test_e30_a_robot_that_forgot_everything_asks_the_others() -> None:
    """The world restarts, and with it all gateways, while robot 4's agent restarts too."""
    scene = Stopped()
    said_at = scene.team.now
    assert scene.stop().complete
    scene.team.kill_gateway(1)
    scene.team.start(4)
    scene.run(0.05).team.start_gateway(1)
    assert scene.run(4.0).moved_since(said_at + 1.5) == set()


def test_a_resume_without_a_stop_changes_nothing_and_is_one_line() -> None:
    node = Stopped().say(stand=False)
    assert node.outcome is None and node.refused == "resume: none of the 4 robots that answer is stopped"


@pytest.mark.parametrize("dead", [1, 3])
def test_a_dead_robots_gateway_answers_too(dead: int) -> None:
    scene = Stopped()
    scene.team.kill(dead)
    assert scene.stop().complete


def test_a_team_that_nobody_stopped_starts_as_soon_as_its_gateways_open() -> None:
    scene = Stopped()
    first = min(at for told in scene.speeds.values() for at, v in told if v > REST_MPS)
    assert first < scene.team.timing.grant_s + 0.1
