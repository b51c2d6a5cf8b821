"""What safety rests on is agreed in the protocol (E25): who holds something else is refused, and the odd one ends."""

from __future__ import annotations

from typing import Any

import pytest
from msgspec import structs

from lfa.deploy.analysis.verification.safety import SAFETY
from lfa.deploy.fuzz.lease_simulation import LeaseSimulation
from lfa.protocol.lease.agreement import NAMES, agreement_of, difference, digest
from lfa.protocol.lease.effects import Effect, Send, StandAside
from lfa.protocol.lease.machine.lease import Lease
from lfa.protocol.lease.timing import timing_of
from lfa.protocol.messages.consensus import Agreement, Hello, LeaseBody, Member, Nack, Prepare, Propose, Term, Version
from lfa.protocol.messages.header import WIRE_VERSION
from lfa.protocol.mission import Mission
from tests.rigs.lease_scenes import STD, TEAM, Team, config_of

OTHER: dict[str, Mission] = {
    "mission.profile": structs.replace(TEAM, profile="wifi"),
    "mission.version": structs.replace(TEAM, version=2),
    "mission.robots": structs.replace(TEAM, robots=(1, 2, 3, 5)),
    "mission.witness": structs.replace(TEAM, witness=False),
    "mission.can_lead": structs.replace(TEAM, can_lead=(1,)),
    "mission.tiebreak": structs.replace(TEAM, tiebreak="none"),
    "mission.shrink": structs.replace(TEAM, shrink="static"),
    "mission.cold_start": structs.replace(TEAM, cold_start="majority"),
    "mission.lonely": structs.replace(TEAM, lonely="continue_after"),
    "mission.continue_after_s": structs.replace(TEAM, continue_after_s=9.0),
}


def agreed(mission: Mission) -> int:
    return digest(agreement_of(mission, timing_of(mission.profile)))


def newcomer(mission: Mission = TEAM) -> Lease:
    """Robot 2, which has waited out its start."""
    lease = Lease(Member(2, 1), mission, timing_of(mission.profile), 0.0, floor=0)
    lease.tick(1.0)
    return lease


def ended(team: LeaseSimulation) -> list[tuple[int, str]]:
    """Who stood aside, and what each said."""
    return [(who, effect.reason) for _, who, effect in team.log if isinstance(effect, StandAside)]


def refusals(effects: list[Effect]) -> list[Agreement | None]:
    return [e.body.agreement for e in effects if isinstance(e, Send) and isinstance(e.body, Nack)]


@pytest.mark.parametrize("name", OTHER)
def test_e25_a_voter_refuses_who_holds_something_else_and_says_what_it_holds_itself(name: str) -> None:
    lease, sender, term = newcomer(), Member(1, 1), Term(9, 1, 1)
    other, own = agreed(OTHER[name]), agreement_of(TEAM, STD)
    said: tuple[LeaseBody, ...] = (
        Prepare(term, Version(), agreed=other, wire=WIRE_VERSION),
        Propose(term, config_of(term), 0, sender, agreed=other, wire=WIRE_VERSION),
        Hello(None, other, WIRE_VERSION),
    )
    for body in said:
        assert refusals(lease.receive(sender, body, 1.0)) == [own], body
    assert lease.config.version == Version(), "nothing in the PROPOSE counts"
    assert lease.leader is None


def test_e25_the_same_is_not_refused() -> None:
    lease, sender, term = newcomer(), Member(1, 1), Term(9, 1, 1)
    propose = Propose(term, config_of(term), 0, sender, agreed=agreed(TEAM))
    assert refusals(lease.receive(sender, propose, 1.0)) == []
    assert lease.leader == 1


def test_e25_what_says_nothing_of_it_is_refused() -> None:
    assert refusals(newcomer().receive(Member(1, 1), Hello(None, wire=WIRE_VERSION), 1.0)) == [agreement_of(TEAM, STD)]


@pytest.mark.parametrize("name", OTHER)
def test_e25_who_joins_a_team_with_another_mission_ends_and_names_what_differs(name: str) -> None:
    team = Team()
    team.kill(3)
    team.run(1.5)
    team.start(3, mission=OTHER[name])
    team.run(3.0)
    [(who, reason)] = ended(team)
    assert who == 3
    assert reason.startswith(f"{name} = ") and "robot1, robot2, robot4" in reason
    assert "\n" not in reason
    assert team.leaders() == [1]
    assert team.changes() == [(3, "StandAside")]
    team.start(3)
    team.run(4.0)
    assert set(team.lease_of(1).chain) == {1, 2, 3, 4}, "with the right mission it is taken in"
    assert team.safe()


def test_e25_the_odd_one_of_a_fleet_that_starts_ends_and_the_others_stay() -> None:
    team = LeaseSimulation(4)
    for robot_id in team.ids:
        team.at(0.0, team.start, robot_id, None, OTHER["mission.profile"] if robot_id == 3 else None)
    team.run(2.0)
    assert [who for who, _ in ended(team)] == [3]
    team.start(3)
    team.run(4.0)
    assert team.leaders() == [1]


def test_e25_one_against_one_both_wait() -> None:
    """Nobody is the odd one: neither ends, neither leads."""
    team = LeaseSimulation(2, witness=False)
    team.start(1)
    team.start(2, mission=structs.replace(team.mission, profile="wifi"))
    team.run(10.0)
    assert ended(team) == []
    assert team.leaders() == []


def test_e25_who_leads_or_follows_is_ended_by_nobody() -> None:
    """Three of five come back with another mission: the leader and the witness go on."""
    team = Team()
    for robot_id in (2, 3, 4):
        team.kill(robot_id)
        team.run(team.now + 2.0)
    for robot_id in (2, 3, 4):
        team.start(robot_id, mission=OTHER["mission.version"])
    team.run(team.now + 1.0)
    assert 1 not in [who for who, _ in ended(team)]
    assert team.leaders() == [1]


def test_e25_a_mixed_team_has_one_leader_through_a_cut() -> None:
    """A leader whose lease is longer than the others' bonds would be obeyed beside the next one."""
    team = LeaseSimulation(4)
    checkers = [checker(team.timing) for checker in SAFETY]
    team.listen(checkers)
    team.start_all().run(0.01)
    team.start(1, mission=OTHER["mission.profile"])
    team.run(1.5)
    team.cut((1,))
    team.run(4.0)
    assert [v for checker in checkers for v in checker.violations] == []


def test_e25_every_field_is_compared_and_has_a_name() -> None:
    assert [field for field, _ in NAMES] == [f.name for f in sorted_fields()]
    own = agreement_of(TEAM, STD)
    for name, mission in OTHER.items():
        found = difference(own, agreement_of(mission, timing_of(mission.profile)))
        assert found is not None
        assert found[0] == name


def sorted_fields() -> list[Any]:
    order = {field: n for n, (field, _) in enumerate(NAMES)}
    return sorted(structs.fields(Agreement), key=lambda f: order[f.name])
