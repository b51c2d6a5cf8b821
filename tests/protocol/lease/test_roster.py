"""E33 and E34: spares join and robots retire by configs; one rule a test."""

from __future__ import annotations

import pytest
from msgspec import structs

from lfa.protocol.errors import Refused
from lfa.protocol.lease.membership import is_spare, joined, retired
from lfa.protocol.messages.consensus import LeaseBody, Prepare, Promise, Propose, Roster, Spare, Version
from tests.rigs.lease_scenes import Team, sent

ROBOTS = (1, 2, 3, 4)


class Operated(Team):
    """Team with spares, whose operator speaks to the leader."""

    def join(self, robot: int, slot_of: int = 0) -> None:
        lease = self.lease_of(self.leaders()[0])
        self._change(joined(lease.config.roster, self.mission.robots, lease.chain, robot, slot_of))

    def retire(self, robot: int) -> None:
        lease = self.lease_of(self.leaders()[0])
        self._change(retired(lease.config.roster, self.mission.robots, lease.chain, robot))

    def _change(self, roster: Roster) -> None:
        process = self.processes[self.leaders()[0]]
        self.carry_out(process, process.lease.request_roster(roster, process.clock.local(self.now)))

    def voters(self) -> set[int]:
        return {voter.id for voter in self.lease_of(self.leaders()[0]).config.voters}


def test_e33_a_spare_that_nobody_admitted_is_in_no_chain_and_stands_for_no_election() -> None:
    team = Operated(spares=(7,))
    team.run(2.0)
    assert team.lease_of(7).chain == team.lease_of(1).chain == ROBOTS
    for robot in ROBOTS:
        team.kill(robot)
    team.run(6.0)
    assert team.leaders() == []


def test_e33_an_admitted_spare_joins_the_tail_and_votes_by_a_joint_config() -> None:
    team = Operated(spares=(7,))
    team.join(7)
    team.run(2.0)
    assert team.lease_of(7).chain == team.lease_of(4).chain == (1, 2, 3, 4, 7)
    assert team.voters() == {0, 1, 2, 3, 4, 7}
    assert team.changes() in ([], [(1, "BecomeLeader")]), "only the leader's own term may have been raised"
    assert team.safe()


def test_e33_a_spare_that_is_switched_on_after_its_admission_joins_then() -> None:
    team = Operated(spares=(7,))
    team.kill(7)
    team.join(7)
    team.run(2.0)
    assert team.lease_of(4).chain == ROBOTS
    team.start(7)
    team.run(3.0)
    assert team.lease_of(7).chain == (1, 2, 3, 4, 7)


@pytest.mark.parametrize(("lost", "chain"), [(2, (1, 7, 3, 4)), (3, (1, 2, 7, 4)), (4, (1, 2, 3, 7))])
def test_e33_a_spare_takes_the_place_of_a_lost_robot(lost: int, chain: tuple[int, ...]) -> None:
    team = Operated(spares=(7,))
    team.kill(lost)
    team.run(2.0)
    team.join(7, slot_of=lost)
    team.run(3.0)
    assert team.lease_of(1).chain == chain
    assert team.safe()


def test_e33_l6_a_spare_leads_when_it_is_the_next() -> None:
    team = Operated(2, spares=(7,))
    team.join(7)
    team.run(3.0)
    team.kill(1)
    team.run(5.0)
    team.kill(2)
    team.run(7.0)
    assert team.leaders() == [7]
    assert team.safe()


def test_e33_spares_are_fewer_than_the_other_voters_also_when_these_are_lost() -> None:
    team = Operated(2, spares=(7, 8, 9, 10))
    for n, spare in enumerate((7, 8, 9, 10)):
        team.join(spare)
        team.run(2.0 + n)
    assert team.lease_of(1).chain == (1, 2, 7, 8, 9, 10)
    assert team.voters() == {0, 1, 2, 7, 8}
    team.kill(2)
    team.run(8.0)
    assert team.voters() == {0, 1, 7}
    assert team.safe()


def test_e33_a_leader_that_dies_before_the_change_is_accepted_leaves_the_team_as_it_was_or_changed() -> None:
    team = Operated(spares=(7,))
    team.filter = lambda here, to, body: None if here == 1 else 0.0
    team.join(7)
    team.kill(1)
    team.filter = None
    team.run(3.0)
    assert team.lease_of(2).chain == (2, 3, 4)
    team.join(7)
    team.run(4.0)
    assert team.lease_of(2).chain == (2, 3, 4, 7)
    assert team.safe()


def test_e33_a_team_that_loses_its_memory_but_for_a_spare_goes_on_with_it() -> None:
    team = Operated(spares=(7,))
    team.join(7)
    team.run(3.0)
    for robot in (0, *ROBOTS):
        team.start(robot)
    team.run(6.0)
    leader = team.leaders()[0]
    assert is_spare(team.lease_of(leader).config.roster, 7)
    assert set(team.lease_of(leader).chain) == {*ROBOTS, 7}
    assert team.safe()


def test_e33_a_spare_that_remembers_alone_makes_a_full_house_with_itself() -> None:
    team = Operated(2, spares=(7,))
    team.join(7)
    team.run(3.0)
    team.filter = lambda here, to, body: None if isinstance(body, Prepare) and here in (1, 2) else 0.0
    for robot in (0, 1, 2):
        team.start(robot)
    team.run(6.0)
    assert team.leaders() == [7], "the others are not heard when they stand"
    assert team.safe()


def test_e34_the_chain_closes_over_a_retired_robot_and_it_neither_votes_nor_returns() -> None:
    team = Operated()
    team.retire(3)
    team.run(5.0)
    assert team.lease_of(3).chain == team.lease_of(4).chain == (1, 2, 4)
    assert team.voters() == {0, 1, 2, 4}
    team.start(3)
    team.run(8.0)
    assert team.lease_of(3).chain == team.lease_of(4).chain == (1, 2, 4)
    assert team.safe()


def test_e34_a_retired_robot_never_leads_also_if_it_missed_its_retirement() -> None:
    team = Operated()
    team.cut((2,))
    team.retire(2)
    team.run(3.0)
    team.kill(1)
    team.heal()
    team.run(6.0)
    assert team.leaders() == [3]
    assert all(who != 2 for who, _ in team.changes())
    assert team.safe()


def test_e34_a_candidate_that_learns_of_its_retirement_gives_up() -> None:
    team = Operated(3)
    team.cut((2,))
    team.retire(2)
    team.run(3.0)
    team.cut((2, 3), (0, 1))
    team.kill(1, hinted=False)
    team.run(5.0)
    team.heal()
    team.run(8.0)
    assert team.leaders() == [3]
    assert team.safe()


def test_e34_a_candidate_gives_up_too_when_a_late_propose_tells_it_of_its_retirement() -> None:
    team = Operated(3)
    lease = team.lease_of(2)
    config = lease.config
    heard = structs.replace(config, version=Version(config.version.term, config.version.seq + 1))
    heard = structs.replace(heard, chain=config.chain[::2], roster=Roster(retired=(2,)))
    heard = structs.replace(heard, voters=tuple(voter for voter in config.voters if voter.id != 2))
    asked: list[LeaseBody] = []
    while not asked:
        stands_at = lease.next_deadline()
        asked = sent(lease.tick(stands_at), Prepare)
    [prepare] = asked
    assert isinstance(prepare, Prepare)
    leader = config.chain[0]
    lease.receive(leader, Propose(config.version.term, heard, 9, leader, agreed=lease.agreed), stands_at)
    promises = [Promise(prepare.term, heard, None, False)] * 3
    effects = [e for m, p in zip(config.voters, promises, strict=False) for e in lease.receive(m, p, stands_at)]
    assert lease.config == heard
    assert sent([*effects, *lease.tick(stands_at + 1.0)], Prepare) == sent(effects, Propose) == []


def test_e34_a_retired_robot_never_leads_also_when_nobody_else_is_left() -> None:
    team = Operated(2)
    team.retire(2)
    team.run(3.0)
    team.kill(1)
    team.run(6.0)
    assert team.leaders() == []
    assert team.safe()


def test_e34_nobody_retires_itself_and_after_its_hand_over_the_next_retires_it() -> None:
    team = Operated()
    team.retire(1)
    team.run(1.5)
    assert team.lease_of(4).chain == ROBOTS
    team.hand_over(1)
    team.run(2.0)
    team.retire(1)
    team.run(4.0)
    assert team.leaders() == [2]
    assert team.lease_of(1).chain == team.lease_of(4).chain == (2, 3, 4)
    assert team.safe()


def test_e34_a_retired_robot_that_joins_again_comes_to_the_tail() -> None:
    team = Operated()
    team.retire(2)
    team.run(3.0)
    team.join(2)
    team.run(5.0)
    assert team.lease_of(2).chain == team.lease_of(4).chain == (1, 3, 4, 2)
    assert team.voters() == {0, *ROBOTS}


NONE, SEVEN, WITHOUT_3 = Roster(), Roster((Spare(7),)), Roster((), (3,))


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (lambda: joined(NONE, ROBOTS, ROBOTS, 2, 0), "join 2: this id is in use, must be none of [1, 2, 3, 4]"),
        (lambda: joined(SEVEN, ROBOTS, ROBOTS, 7, 0), "join 7: this id is in use, must be none of [1, 2, 3, 4, 7]"),
        (
            lambda: joined(NONE, ROBOTS, ROBOTS, 7, 9),
            "join 7 --for 9: must be a robot of the mission, one of [1, 2, 3, 4]",
        ),
        (
            lambda: joined(NONE, ROBOTS, ROBOTS, 7, 3),
            "join 7 --for 3: robot3 is in the chain, must be out of it",
        ),
        (
            lambda: joined(Roster(tuple(map(Spare, range(10, 26)))), ROBOTS, ROBOTS, 7, 0),
            "join 7: 16 spares have joined, must be at most 16",
        ),
        (lambda: retired(NONE, ROBOTS, ROBOTS, 7), "retire 7: not in the team, must be one of [1, 2, 3, 4]"),
        (lambda: retired(WITHOUT_3, ROBOTS, (1, 2, 4), 3), "retire 3: not in the team, must be one of [1, 2, 4]"),
        (
            lambda: retired(NONE, ROBOTS, (1,), 1),
            "retire 1: robot1 is the last of the chain, must leave another one there",
        ),
    ],
)
def test_e33_e34_what_cannot_be_is_refused_in_one_line(call, line: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(Refused) as refused:
        call()
    assert str(refused.value) == line
