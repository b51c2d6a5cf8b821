"""4 -> 3 -> 2 -> 1: robots killed one after another, in every order, in virtual time."""

from __future__ import annotations

from itertools import permutations

import pytest
from msgspec import structs

from lfa.deploy.fuzz.agent_simulation import AgentSimulation
from lfa.deploy.fuzz.network import FAIR
from lfa.deploy.fuzz.schedules import draw
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.team import Event
from lfa.protocol.names import robot_id_of

ROBOTS = (1, 2, 3, 4)
ROAD_M = 4.0
"""Further than anybody comes before the last one is alone: the dead are obstacles, also on a goal."""
FIRST_S, EVERY_S = 1.0, 1.5
"""By the next kill the dead one's vote is gone too (t_remove); faster ones can take the quorum away."""
ARRIVED_S = 40.0


@pytest.mark.parametrize("first", ROBOTS)
def test_in_every_order_the_chain_is_the_old_one_without_the_dead_and_the_last_one_arrives(first: int) -> None:
    for order in permutations(ROBOTS, 3):
        if order[0] == first:
            _check(order)


def _check(order: tuple[int, ...]) -> None:
    schedule = structs.replace(
        draw(0), robots=4, profile="std", witness=True, rates={}, faults=(), spares=(), radio=FAIR
    )
    team = AgentSimulation(schedule, ROAD_M)
    arrived: list[str] = []
    left = list(ROBOTS)

    def hear(_now: float, _key: str, _payload: bytes, message: Message) -> None:
        if isinstance(message, Event) and message.kind == "goal":
            arrived.append(message.header.sender)
            if left == [robot_id_of(message.header.sender)]:
                team.simulator.halt()

    team.simulator.taps.append(hear)
    team.start_all().run(FIRST_S)
    for victim in order:
        team.kill(victim)
        left.remove(victim)
        team.run(team.now + EVERY_S)
        assert team.leaders() == left[:1], f"killed in the order {order}"
        assert [team.lease_of(robot).chain for robot in left] == [tuple(left)] * len(left), f"killed so far of {order}"
    team.run(ARRIVED_S)
    assert f"robot{left[0]}" in arrived, f"robot {left[0]}, the last of {order}, does not arrive"
