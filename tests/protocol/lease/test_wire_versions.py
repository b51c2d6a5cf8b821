"""Two neighbouring versions of the messages in one fleet (E35) lead each other; what is further off is refused."""

from __future__ import annotations

from typing import Any

import pytest
from msgspec import structs

from lfa.protocol.lease.agreement import agreement_of
from lfa.protocol.lease.effects import StandAside
from lfa.protocol.lease.machine.lease import Lease
from lfa.protocol.messages.consensus import Agreement, Hello, LeaseBody, Member, Nack, Prepare, Propose, Term
from lfa.protocol.messages.header import UNSAID_WIRE, WIRE_VERSION
from tests.protocol.lease.test_agreement import agreed, newcomer, refusals
from tests.rigs.lease_scenes import STD, TEAM, Team, config_of

BEFORE = WIRE_VERSION - 1
FAR = (WIRE_VERSION - 2, WIRE_VERSION + 2, 2**53)


class MixedTeam(Team):
    """Team in which robots `before` speak the version before: what this one adds is not in their messages."""

    def __init__(self, before: tuple[int, ...], **options: Any) -> None:
        self.before = before
        super().__init__(**options)

    def _post(self, src: Member, here: int, to: int, body: LeaseBody) -> None:
        if src.id in self.before and isinstance(body, Prepare | Propose | Hello):
            body = structs.replace(body, wire=UNSAID_WIRE)
        super()._post(src, here, to, body)


def of_wire(wire: int) -> Agreement:
    return structs.replace(agreement_of(TEAM, STD), wire=wire)


@pytest.mark.parametrize("before", [(1,), (2, 3), (1, 2, 3, 4), (0,), (2, 4)])
def test_e35_a_leader_of_either_version_leads_and_the_next_of_either_takes_over(before: tuple[int, ...]) -> None:
    team = MixedTeam(before)
    team.kill(1)
    team.run(3.0)
    assert team.leaders() == [2]
    team.hand_over(2)
    team.run(4.0)
    assert team.leaders() == [3]
    assert team.lease_of(4).chain == (3, 4, 2)
    assert team.safe()


def test_e35_each_robot_in_its_turn_restarts_in_the_new_version_the_leader_last() -> None:
    team = MixedTeam((0, 1, 2, 3, 4))
    for robot in (0, 4, 3, 2):
        team.before = tuple(other for other in team.before if other != robot)
        team.start(robot)
        team.run(team.now + 2.0)
        assert team.leaders() == [1]
    team.before = ()
    team.hand_over(1)
    team.run(team.now + 1.0)
    team.start(1)
    team.run(team.now + 2.0)
    (leader,) = team.leaders()
    assert set(team.lease_of(leader).chain) == {1, 2, 3, 4}
    assert team.safe()


@pytest.mark.parametrize("wire", FAR)
def test_e35_a_version_further_off_is_refused_with_the_own_one(wire: int) -> None:
    lease, sender, term = newcomer(), Member(1, 1), Term(9, 1, 1)
    said: tuple[LeaseBody, ...] = (
        Prepare(term, config_of(term).version, agreed=agreed(TEAM), wire=wire),
        Propose(term, config_of(term), 0, sender, agreed=agreed(TEAM), wire=wire),
        Hello(None, agreed(TEAM), wire),
    )
    for body in said:
        assert refusals(lease.receive(sender, body, 1.0)) == [of_wire(WIRE_VERSION)], body
    assert lease.leader is None


@pytest.mark.parametrize("wire", [BEFORE, WIRE_VERSION, WIRE_VERSION + 1])
def test_e35_a_neighbour_is_not_refused(wire: int) -> None:
    lease, sender, term = newcomer(), Member(1, 1), Term(9, 1, 1)
    assert (
        refusals(lease.receive(sender, Propose(term, config_of(term), 0, sender, (), None, agreed(TEAM), wire), 1.0))
        == []
    )
    assert lease.leader == 1


def outvoted(lease: Lease, agreement: Agreement) -> list[str]:
    """Return what the lease says when others refuse it with this agreement."""
    reasons: list[str] = []
    for robot in (1, 3):
        nack = Nack(Term(), Term(), None, 0.0, lease.config, agreement)
        effects = lease.receive(Member(robot, 1), nack, 5.0)
        reasons += [effect.reason for effect in effects if isinstance(effect, StandAside)]
    return reasons[:1]


def test_e35_whom_a_fleet_of_a_version_further_off_refuses_ends_with_one_line() -> None:
    said = f"version of the messages = {WIRE_VERSION}: must be {WIRE_VERSION + 2}, which robot1, robot3 hold"
    assert outvoted(newcomer(), of_wire(WIRE_VERSION + 2)) == [said]


def test_e35_to_a_neighbour_the_difference_is_what_else_differs_not_the_version() -> None:
    other = structs.replace(of_wire(BEFORE), version=2)
    assert outvoted(newcomer(), other) == ["mission.version = 1: must be 2, which robot1, robot3 hold"]
    body = Hello(None, agreed(structs.replace(TEAM, version=2)), BEFORE)
    assert refusals(newcomer().receive(Member(1, 1), body, 1.0)) == [of_wire(BEFORE)]
