"""E33 and E34 with whole robots in virtual time: spares join and robots retire while the team drives."""

from __future__ import annotations

import pytest
from msgspec import structs

from lfa.agents.orders.roster_orders import JOIN, QUESTION, RETIRE
from lfa.deploy.client.operator import Operator
from lfa.deploy.client.roster.roster_call import RosterCall, RosterOutcome
from lfa.deploy.fuzz.agent_simulation import FLEET, AgentSimulation
from lfa.deploy.fuzz.network import FAIR
from lfa.deploy.fuzz.schedules import draw
from lfa.deploy.operate.join import outcome_text
from lfa.protocol.errors import Refused
from lfa.protocol.geometry import Pose2D
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.simulation import Truth
from lfa.protocol.messages.team import Event, Status
from lfa.protocol.transport.message_bus import send

DRIVING_S = 4.0
STEP_S = 0.01


class Operated:
    """A team of three that drives along a straight road, with robot 7 beside it that its mission does not name."""

    def __init__(self) -> None:
        calm = structs.replace(draw(0), robots=3, profile="std", witness=True, rates={}, faults=(), radio=FAIR)
        self.team = AgentSimulation(structs.replace(calm, spares=(7,)))
        self.places: dict[int, Pose2D] = {}
        self.speed: dict[int, float] = {}
        self.texts: dict[str, str] = {}
        self._call: RosterCall | None = None
        self.team.simulator.taps.append(self._hear)
        self.team.start_all().run(DRIVING_S)

    def _hear(self, now: float, _key: str, _payload: bytes, message: Message) -> None:
        match message:
            case Truth():
                self.places = {robot.id: Pose2D(robot.x, robot.y, robot.theta) for robot in message.robots}
                self.speed = {robot.id: abs(robot.linear_x) for robot in message.robots}
            case Status():
                self.texts[message.header.sender] = message.text
            case Event() if self._call is not None:
                self._call.hear(message, now)

    def say(self, command: str, robot: int, slot_of: int = 0) -> RosterOutcome:
        """Say join or retire as the command does, and run until the outcome is final. Raises Refused."""
        team, operator = self.team, Operator(FLEET, round(1000 * self.team.now))
        call = self._call = RosterCall(command, robot, slot_of, team.now)
        while (outcome := call.outcome(team.now)) is None:
            if call.due(team.now):
                asked = operator.ask(QUESTION, team.now)
                said = operator.command(command, team.now, **call.arguments)
                send(team.simulator, asked if call.asks else said)
            team.run(team.now + STEP_S)
        return outcome

    def run(self, for_s: float) -> Operated:
        self.team.run(self.team.now + for_s)
        return self


def test_e33_a_spare_comes_to_the_tail_and_drives_with_the_team() -> None:
    team = Operated()
    assert team.speed[7] == 0.0
    assert "a spare: lfa join 7 takes it in" in team.texts["robot7"]
    outcome = team.say(JOIN, 7)
    assert outcome_text(JOIN, outcome) == "join: robot7 is in the team; the chain is [1, 2, 3, 7]"
    team.run(25.0)
    assert team.places[7].x > 5.0
    assert team.places[7].x < team.places[3].x


def test_e33_a_spare_takes_the_place_of_a_lost_robot() -> None:
    team = Operated()
    team.team.kill(2)
    team.run(3.0)
    assert team.say(JOIN, 7, slot_of=2).chain == (1, 7, 3)


def test_e34_a_retired_follower_stands_and_the_rest_close_up() -> None:
    team = Operated()
    outcome = team.say(RETIRE, 2)
    assert outcome_text(RETIRE, outcome) == "retire: robot2 is out of the team; the chain is [1, 3]"
    team.run(4.0)
    assert team.speed[2] == 0.0
    assert team.speed[3] > 0.2
    assert "retired: lfa join 2 takes it back" in team.texts["robot2"]
    assert team.say(JOIN, 2).chain == (1, 3, 2)


def test_e34_a_retired_leader_hands_over_first() -> None:
    team = Operated()
    outcome = team.say(RETIRE, 1)
    assert (outcome.accepted, outcome.leader, outcome.chain) == (True, 2, (2, 3))
    team.run(3.0)
    assert team.speed[1] == 0.0
    assert team.speed[3] > 0.2


def test_e33_a_leader_that_dies_right_after_the_word_costs_nothing_but_time() -> None:
    team = Operated()
    team.team.at(team.team.now + 0.05, team.team.kill, 1)
    outcome = team.say(JOIN, 7)
    assert (outcome.accepted, outcome.leader, outcome.chain) == (True, 2, (2, 3, 7))


@pytest.mark.parametrize(
    ("command", "robot", "line"),
    [
        (JOIN, 2, "join 2: this id is in use, must be none of [1, 2, 3]"),
        (RETIRE, 9, "retire 9: not in the team, must be one of [1, 2, 3]"),
    ],
)
def test_e33_e34_what_cannot_be_is_refused_before_it_is_said(command: str, robot: int, line: str) -> None:
    team = Operated()
    with pytest.raises(Refused) as refused:
        team.say(command, robot)
    assert str(refused.value) == line
    assert team.team.lease_of(1).config.roster == team.team.lease_of(2).config.roster


@pytest.mark.parametrize(
    ("robot", "ended", "line"),
    [
        (9, (), "join 9: nobody of this id is heard, must run first: lfa-agent --id 9 --spare"),
        (7, (7,), "join 7: nobody of this id is heard, must run first: lfa-agent --id 7 --spare"),
    ],
)
def test_e33_a_robot_that_nobody_hears_does_not_join(robot: int, ended: tuple[int, ...], line: str) -> None:
    team = Operated()
    for other in ended:
        team.team.kill(other)
    team.run(5.0)
    before = team.team.lease_of(1).config
    outcome = team.say(JOIN, robot)
    assert (outcome.accepted, outcome.reason) == (False, line)
    assert team.team.lease_of(1).config == before


def test_e34_a_retired_robot_whose_process_has_ended_does_not_join_again() -> None:
    team = Operated()
    assert team.say(RETIRE, 3).accepted
    team.team.kill(3)
    team.run(5.0)
    assert team.say(JOIN, 3).reason == "join 3: nobody of this id is heard, must run first: lfa-agent --id 3"


def test_e34_the_last_of_the_chain_does_not_retire() -> None:
    team = Operated()
    for robot in (2, 3):
        assert team.say(RETIRE, robot).accepted
    with pytest.raises(Refused, match="retire 1: robot1 is the last of the chain, must leave another one there"):
        team.say(RETIRE, 1)
