"""Voters and chain: who goes, who comes, who counts; one rule a test."""

from __future__ import annotations

import pytest

from lfa.protocol.lease.machine.lease import Lease
from lfa.protocol.lease.membership import ids, led_by
from lfa.protocol.messages.consensus import Hello, Member, Nack, Term
from lfa.protocol.mission import Leading, Mission
from tests.rigs.lease_scenes import STD, Team, config_of, sent


def test_e8_a_silent_follower_leaves_the_chain_after_t_chain_and_the_order_stays() -> None:
    team = Team()
    team.kill(3, hinted=False)
    team.run(1.0 + STD.chain_silence_s - 0.1)
    assert team.lease_of(4).chain == (1, 2, 3, 4)
    team.run(1.0 + STD.chain_silence_s + 0.1)
    assert team.lease_of(4).chain == (1, 2, 4)


def test_e8_the_chain_closes_over_a_vanished_token_at_once() -> None:
    team = Team()
    team.kill(3)
    team.run(1.03)
    assert team.lease_of(4).chain == (1, 2, 4)
    assert team.changes() == []


def test_e9_a_robot_that_was_out_returns_at_the_tail() -> None:
    team = Team()
    team.kill(2)
    team.run(2.0)
    team.start(2)
    team.run(3.0)
    assert team.lease_of(2).chain == team.lease_of(4).chain == (1, 3, 4, 2)
    assert team.changes() in ([], [(1, "BecomeLeader")]), "only the leader's own term may have been raised"


def test_e9_a_robot_in_place_without_a_vote_says_hello_to_its_leader_alone_and_stays_in_the_chain() -> None:
    """To all, a team of 30 would hear 6000 of them a second."""
    team = Team(robots=9, led_by=3.0)
    for leader, until in ((1, 4.0), (2, 6.0)):
        team.run(until)
        alive = range(leader, 10)
        before = {robot: team.lease_of(robot).hello_of(9) for robot in alive}
        team.run(until + 1.0)
        assert [robot for robot in alive if team.lease_of(robot).hello_of(9) != before[robot]] == [leader]
        assert team.lease_of(9).me not in team.lease_of(9).config.voters
        assert team.lease_of(leader).chain == tuple(alive)
        team.kill(leader)
    assert team.safe()


def test_e9_in_the_first_start_of_many_robots_few_answer_who_says_hello() -> None:
    """Each answer has the names of all: of N robots they would be N squared, eight times a second."""
    mission = Mission(robots=tuple(range(1, 31)))
    first = [Lease(Member(id, 1), mission, STD, 0.0, floor=0) for id in (*mission.robots, 0)]
    hello = Hello(None, first[0].agreed)
    answering = [id for id, lease in zip((*mission.robots, 0), first, strict=True) if _answers(lease, hello, 0.1)]
    assert answering == [1, 2, 3, 4, 5, 6, 7]


def test_e9_a_spare_that_remembers_no_config_answers_in_a_small_team() -> None:
    mission = Mission(robots=(1, 2))
    spare = Lease(Member(7, 1), mission, STD, 0.0, floor=0)
    assert _answers(spare, Hello(None, spare.agreed), 0.1)


def test_e9_who_remembers_a_config_tells_it_to_a_blank_robot_whatever_its_own_id() -> None:
    team = Team(robots=9, led_by=3.0)
    for id in range(1, 9):
        team.kill(id)
    team.run(6.0)
    last = team.lease_of(9)
    assert last.leader is None
    assert _answers(last, Hello(None, last.agreed), team.processes[9].clock.local(team.now))


def test_e22_a_robot_left_out_stays_out_though_it_asks_and_returns_at_the_tail() -> None:
    team = Team()
    team.lease_of(1).left_out = frozenset({2})
    team.run(3.0)
    assert team.lease_of(1).chain == team.lease_of(2).chain == team.lease_of(4).chain == (1, 3, 4)
    assert len(team.lease_of(1).config.voters) == 5, "it lives: it votes"
    team.lease_of(1).left_out = frozenset()
    team.run(5.0)
    assert team.lease_of(2).chain == team.lease_of(4).chain == (1, 3, 4, 2)
    assert team.changes() in ([], [(1, "BecomeLeader")]), "only the leader's own term may have been raised"
    assert team.safe()


def test_e9_the_leader_that_was_killed_returns_at_the_tail() -> None:
    team = Team()
    team.kill(1)
    team.at(1.05, team.start, 1)
    team.run(3.0)
    assert team.leaders() == [2]
    assert team.lease_of(1).chain == (2, 3, 4, 1)
    assert team.safe()


def test_more_than_seven_robots_lead_with_seven_voters_and_all_follow() -> None:
    team = Team(20)
    team.run(4.0)
    assert len(team.lease_of(1).config.voters) == 7
    assert team.lease_of(20).chain == tuple(range(1, 21))
    team.kill(15)
    team.kill(1)
    team.run(5.0)
    assert team.leaders() == [2]
    assert team.lease_of(20).chain == tuple(i for i in range(2, 21) if i != 15)
    assert team.safe()


@pytest.mark.parametrize("robots", [16, 64, 128])
def test_large_teams_have_seven_voters_and_a_new_leader_as_fast_as_small_ones(robots: int) -> None:
    """From the cold start to the chain of all, then the leader and a learner die together."""
    team = Team(robots, led_by=1.5)
    version = team.lease_of(1).config.version
    team.run(2.0)
    assert team.lease_of(robots).chain == tuple(range(1, robots + 1))
    assert team.lease_of(1).config.version == version, "the chain does not flap"
    assert len(team.lease_of(1).config.voters) == 7
    team.kill(robots - 2)
    team.kill(1)
    team.run(2.5)
    assert team.leaders() == [2]
    assert team.led_at(2.0) - 2.0 < 0.04
    left = tuple(i for i in range(2, robots + 1) if i != robots - 2)
    assert {team.lease_of(i).chain for i in left} == {left}
    assert team.safe()


@pytest.mark.parametrize("order", [(1, 2, 3), (3, 1, 4), (4, 3, 2), (2, 1, 4)])
def test_e17_a_team_shrinks_one_by_one_to_the_last_and_the_chain_is_the_old_one_minus_the_dead(
    order: tuple[int, ...],
) -> None:
    team = Team()
    left = [1, 2, 3, 4]
    for victim in order:
        team.kill(victim)
        left.remove(victim)
        team.run(team.now + STD.remove_silence_s + 0.3)
        assert team.leaders() == left[:1]
        assert team.lease_of(left[-1]).chain == tuple(left)
        assert team.safe()
    assert {m.id for m in team.lease_of(left[0]).config.voters} == {0, left[0]}


def test_e17_without_a_quorum_nobody_shrinks_the_team() -> None:
    team = Team()
    for victim in (1, 2, 3):
        team.kill(victim)
    team.run(6.0)
    assert team.leaders() == []
    assert len(team.lease_of(4).config.voters) == 5


def test_e17_a_restarted_robot_votes_in_its_new_life_within_two_heartbeats() -> None:
    team = Team()
    old = team.processes[3].member
    team.kill(3)
    team.start(3)
    team.run(1.0 + 4 * STD.heartbeat_s)
    voters = team.lease_of(1).config.voters
    assert team.processes[3].member in voters
    assert old not in voters
    assert team.lease_of(1).config.previous is None
    assert team.safe()


def test_bug_7_an_amnesiac_does_not_bring_an_old_majority_back() -> None:
    """The design's 3.6: two are cut off and removed; of the two that go on one forgets everything, and joins them."""
    team = Team()
    team.cut((3, 4))
    team.run(4.0)
    assert team.leaders() == [1]
    assert {m.id for m in team.lease_of(1).config.voters} == {0, 1, 2}
    known = team.lease_of(4).config.version
    team.kill(2, hinted=False)
    team.heal()
    team.cut((2, 3, 4))
    team.start(2)
    team.run(8.0)
    assert team.leaders() == [1]
    assert team.lease_of(4).config.version == known, "proposed on the promise of one that has forgotten"
    assert team.safe()
    team.heal()
    team.run(11.0)
    assert team.leaders() == [1]
    assert sorted(team.lease_of(4).chain) == [1, 2, 3, 4]
    assert team.safe()


def test_e16_a_successor_that_was_not_the_next_leads_the_chain_before_it_and_the_old_leader_goes_to_its_tail() -> None:
    config = config_of(Term(1, 1, 1))
    for keep_leader, chain in ((True, (3, 2, 4, 1)), (False, (3, 2, 4))):
        written = led_by(config, Member(3, 1), Term(2, 1, 1), lambda _: False, keep_leader)
        assert ids(written.chain) == chain


@pytest.mark.parametrize("cut_off", [(1, 2), (3, 4), (1, 3)])
def test_of_two_halves_the_one_with_the_witness_goes_on(cut_off: tuple[int, ...]) -> None:
    team = Team()
    team.cut(cut_off)
    team.run(4.0)
    stays = [i for i in team.mission.robots if i not in cut_off]
    assert team.leaders() == stays[:1]
    assert sorted(team.lease_of(stays[0]).chain) == stays
    late = [cmd for at, cmd in team.accepted if cmd.holder in cut_off and at > 1.0 + STD.act_s + STD.deadman_s]
    assert late == []
    team.heal()
    team.run(7.0)
    assert len({team.lease_of(i).config.version for i in team.ids}) == 1
    assert sorted(team.lease_of(1).chain) == [1, 2, 3, 4]
    assert team.safe()


def test_the_larger_part_goes_on_without_the_witness() -> None:
    team = Team(5)
    team.cut((2, 3, 4, 5))
    team.run(3.0)
    assert team.leaders() == [2]
    assert team.lease_of(4).chain == (2, 3, 4, 5)
    assert team.safe()


def test_e17_a_witness_that_restarts_is_the_tie_breaker_in_its_new_life() -> None:
    team = Team()
    team.kill(0)
    team.run(1.5)
    assert team.leaders() == [1]
    team.start(0)
    team.run(2.0)
    config = team.lease_of(3).config
    assert config.tie == team.processes[0].member
    assert config.tie in config.voters
    assert config.previous is None
    assert team.safe()


def test_e18_a_majority_that_lost_its_memory_waits_for_all_and_then_goes_on() -> None:
    team = Team()
    for victim in (1, 2, 3):
        team.kill(victim)
    for victim in (1, 2):
        team.start(victim)
    team.run(4.0)
    assert team.leaders() == []
    team.start(3)
    team.run(6.0)
    assert len(team.leaders()) == 1
    assert sorted(team.lease_of(4).chain) == [1, 2, 3, 4]
    assert team.safe()


def test_shrink_static_keeps_a_majority_of_the_team_as_voters() -> None:
    mission = Mission(robots=(1, 2, 3, 4), shrink="static", leading=Leading(route_m=((1.0, 0.0),)))
    team = Team(mission=mission)
    for victim in (4, 3):
        team.kill(victim)
        team.run(team.now + 2.0)
    assert team.leaders() == [1]
    assert len(team.lease_of(1).config.voters) == 3
    team.kill(2)
    team.run(team.now + 2.0)
    assert team.leaders() == [1]
    assert len(team.lease_of(1).config.voters) == 3


def test_tiebreak_head_lets_one_of_two_go_on_without_a_witness() -> None:
    mission = Mission(robots=(1, 2), witness=False, tiebreak="head", leading=Leading(route_m=((1.0, 0.0),)))
    team = Team(mission=mission)
    team.run(2.0)
    team.kill(2)
    team.run(4.0)
    assert team.leaders() == [1]
    assert team.safe()


def test_learners_move_up_when_voters_die() -> None:
    team = Team(12)
    team.run(3.0)
    for victim in (2, 3, 4):
        team.kill(victim)
        team.run(team.now + 2.0)
    voters = {m.id for m in team.lease_of(1).config.voters}
    assert voters == {0, 1, 5, 6, 7, 8, 9}
    assert team.safe()


def _answers(lease: Lease, hello: Hello, now: float) -> bool:
    """Return whether `lease` answers the `hello` of a robot 8, started again."""
    return bool(sent(lease.receive(Member(8, 99), hello, now), Nack))
