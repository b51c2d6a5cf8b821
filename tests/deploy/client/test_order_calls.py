"""Changes of the mission that ROS users ask for: who is told what became of them."""

from __future__ import annotations

from msgspec import structs

from lfa.deploy.client.mission_changes import along, unchanged
from lfa.deploy.client.operator import Operator
from lfa.deploy.client.order_call import ANSWER_S
from lfa.deploy.client.order_calls import OrderCalls
from lfa.protocol.messages.consensus import Term
from lfa.protocol.messages.orders import OrderNote, TeamOrder
from lfa.protocol.messages.team import Ask, Event
from lfa.protocol.mission import Mission
from lfa.protocol.node import Envelope
from tests.deploy.ros.test_mapping import header

MISSION = Mission(robots=(1, 2, 3))
HOLDS = OrderNote(header(), TeamOrder(MISSION.leading, MISSION.formation), Term(1, 1, 1))
WALL = (2.0, -1.0, 2.0, 1.0)


class Team:
    """Orders that were said, and what those who asked were told."""

    def __init__(self) -> None:
        self.said: list[TeamOrder] = []
        self.asked = 0
        self.told: list[tuple[bool, str]] = []
        self.calls = OrderCalls(Operator("f", 1), self._hear)

    def _hear(self, envelope: Envelope) -> None:
        match envelope.message:
            case OrderNote(order=order):
                self.said.append(order)
            case Ask(what="mission"):
                self.asked += 1

    def tell(self, success: bool, text: str) -> None:
        self.told.append((success, text))

    def know(self) -> None:
        self.calls.hear_mission(MISSION)
        self.calls.hear(HOLDS)

    def answer(self, robot: int, by: str, order: TeamOrder | None = None) -> None:
        """Answer as `robot` that it knows order 1: as leader, with the order itself, `order` or the last one said."""
        sender = structs.replace(header(), sender=f"robot{robot}")
        if by == "leader":
            self.calls.hear(OrderNote(sender, order or self.said[-1], Term(1, 1, 1)))
        self.calls.hear(Event(sender, "order", None, {"version": 1, "by": by}))

    def refuse(self) -> None:
        """Answer as leader that order 1 is refused, that of this operator or that of another."""
        data = {"version": 1, "reason": "version 1 holds already"}
        self.calls.hear(Event(structs.replace(header(), sender="robot1"), "order_refused", None, data))


def test_a_pause_is_told_as_carried_out_when_the_leader_and_most_of_the_team_know_it() -> None:
    team = Team()
    team.calls.begin(unchanged, True, 0.0, team.tell)
    team.calls.step(0.0)
    assert (team.asked, team.said) == (1, [])
    team.know()
    team.calls.step(0.1)
    assert [(order.version, order.paused) for order in team.said] == [(1, True)]
    team.answer(1, "leader")
    team.calls.step(0.2)
    assert team.told == []
    team.answer(2, "follower")
    team.calls.step(0.3)
    assert team.told == [(True, "order 1 carried out by robot 1, 2 robots know it")]


def test_an_order_of_another_operator_with_the_same_version_is_not_taken_for_ones_own() -> None:
    team = Team()
    team.know()
    team.calls.begin(unchanged, True, 0.0, team.tell)
    team.know()
    team.calls.step(0.1)
    other = TeamOrder(structs.replace(MISSION.leading, cruise_mps=0.2), MISSION.formation, version=1)
    team.answer(1, "leader", other)
    team.answer(2, "follower")
    team.calls.step(0.2)
    assert team.told == []
    team.refuse()
    team.calls.step(0.3)
    assert team.told == [(False, "robot 1 refuses it: version 1 holds already")]


def test_the_refusal_of_another_operators_order_with_the_same_version_is_not_ones_own() -> None:
    team = Team()
    team.know()
    team.calls.begin(unchanged, True, 0.0, team.tell)
    team.know()
    team.calls.step(0.1)
    team.answer(1, "leader")
    team.refuse()
    team.answer(2, "follower")
    team.calls.step(0.2)
    assert team.told == [(True, "order 1 carried out by robot 1, 2 robots know it")]


def test_a_goal_in_a_wall_is_told_and_nothing_is_said() -> None:
    team = Team()
    team.calls.begin(along(((2.0, 0.0),), (WALL,)), False, 0.0, team.tell)
    team.know()
    team.calls.step(0.1)
    assert team.said == []
    ((success, text),) = team.told
    assert not success
    assert "goal (2, 0): in a wall" in text


def test_a_team_without_a_leader_is_told_after_a_while_and_a_newer_order_ends_an_older_one() -> None:
    team = Team()
    team.calls.begin(unchanged, True, 0.0, team.tell)
    team.calls.begin(unchanged, False, 0.1, team.tell)
    team.calls.step(0.1 + ANSWER_S)
    assert team.told == [(False, "another order came in the meantime"), (False, "no leader has answered")]
