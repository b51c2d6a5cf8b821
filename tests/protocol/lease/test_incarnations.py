"""Numbers of incarnations without a right clock (E23), and gateways that remember more than their leader (E24)."""

from __future__ import annotations

import pytest

from lfa.protocol.incarnations import NUMBERS, after, drawn_at, is_later
from lfa.protocol.lease.failure_detector import IDS_MAX, FailureDetector
from lfa.protocol.lease.gateway import Gateway
from lfa.protocol.lease.machine.lease import Lease
from lfa.protocol.messages.consensus import Hello, Member, Superseded, Term
from tests.rigs.lease_scenes import STD, TEAM, Team, sent

YEAR_S = 3.2e7
SETTLED_S = STD.remove_silence_s + 1.0
STRAYS = (2**53 + 1, 2**53, 2**53 - 1, 2**52 + 2**40, 2**52 - 1, 2**40)


def joined(team: Team, robot_id: int) -> bool:
    """True if the robot's present incarnation is in the leader's chain, and its gateway obeys it."""
    lease, host = team.lease_of(robot_id), team.gateways[robot_id]
    leader = team.lease_of(team.leaders()[0])
    return lease.me in leader.config.chain and host.gateway.agent == lease.me.incarnation


@pytest.mark.parametrize("wrong_s", [-60.0, -56 * YEAR_S, 80 * YEAR_S, -300 * YEAR_S])
def test_e23_a_robot_that_returns_with_another_clock_joins_at_the_tail(wrong_s: float) -> None:
    team = Team()
    team.kill(2)
    team.step_wall(2, wrong_s)
    team.at(2.0, team.start, 2)
    team.run(2.0 + SETTLED_S)
    assert team.lease_of(1).chain == (1, 3, 4, 2)
    assert joined(team, 2)
    assert team.safe()


def test_e23_one_start_with_a_clock_in_the_future_locks_nobody_out() -> None:
    team = Team()
    for at, wrong_s in ((1.5, 80 * YEAR_S), (4.5, 0.0), (7.5, -60.0)):
        team.run(at)
        team.kill(3)
        team.step_wall(3, wrong_s)
        team.start(3)
    team.run(7.5 + SETTLED_S)
    assert joined(team, 3)
    assert team.safe()


@pytest.mark.parametrize("number", STRAYS)
@pytest.mark.parametrize("robot_id", [1, 3])
def test_e23_a_stray_token_locks_nobody_out(number: int, robot_id: int) -> None:
    """It appears and vanishes at all processes and at the robot's gateway; the robot may be the leader."""
    team = Team()
    for up in (True, False):
        for other in (0, 1, 2, 3, 4):
            team.deliver(team.processes[other], team.lease_of(other).hint, (robot_id, number, up))
    team.gateways[robot_id].gateway.agent_up(number, team.gateways[robot_id].clock.local(team.now))
    team.run(1.0 + SETTLED_S)
    assert joined(team, robot_id)
    team.kill(robot_id)
    team.start(robot_id)
    team.run(2.0 + 2.0 * SETTLED_S)
    assert joined(team, robot_id)
    assert team.safe()


def test_e23_the_witness_returns_as_a_voter_with_a_clock_set_back() -> None:
    team = Team()
    team.kill(0)
    team.step_wall(0, -3600.0)
    team.start(0)
    team.run(1.0 + SETTLED_S)
    assert team.lease_of(0).me in team.lease_of(1).config.voters


def test_e23_a_gateway_that_outlived_its_agent_is_enough_to_be_told() -> None:
    """All processes have restarted: nobody but the gateways remembers an earlier incarnation."""
    team = Team()
    for robot_id in team.ids:
        team.kill(robot_id)
        team.step_wall(robot_id, -3600.0)
    team.run(1.5)
    for robot_id in team.ids:
        team.start(robot_id)
    team.run(1.5 + SETTLED_S)
    assert all(joined(team, robot_id) for robot_id in TEAM.robots)
    assert team.safe()


def test_e23_every_process_tells_an_earlier_incarnation_that_says_hello() -> None:
    lease = Lease(Member(2, 5), TEAM, STD, 0.0, floor=0)
    lease.receive(Member(3, 8), Hello(None, lease.agreed), 0.0)
    assert sent(lease.receive(Member(3, 7), Hello(None, lease.agreed), 0.1), Superseded) == [Superseded(8)]
    assert sent(lease.receive(Member(3, 8), Hello(None, lease.agreed), 0.1), Superseded) == []


def test_e23_who_is_told_of_an_earlier_number_goes_on_as_before() -> None:
    lease = Lease(Member(2, 5), TEAM, STD, 0.0, floor=0)
    for number in (4, 5, 2**53 - 1):
        lease.receive(Member(1, 3), Superseded(number), 0.1)
    assert lease.superseded_by is None


@pytest.mark.parametrize("robot_id", [1, 2])
def test_e23_a_member_unseats_neither_a_leader_nor_a_bound_voter_by_a_made_up_later_number(robot_id: int) -> None:
    team = Team()
    liar, process = team.lease_of(3).me, team.processes[robot_id]
    made_up = Superseded(team.lease_of(robot_id).me.incarnation + 1)
    assert team.leaders() == [1]
    team.lease_of(robot_id).receive(liar, made_up, process.clock.local(team.now))
    assert team.lease_of(robot_id).superseded_by is None


def test_e23_a_gateway_obeys_no_earlier_incarnation_and_tells_the_newest() -> None:
    gateway = Gateway(1, 1, STD, 0.0)
    assert gateway.agent is None
    for number in (7, 5, 2**53 - 1):
        gateway.agent_up(number, 1.0)
    assert gateway.agent == 7


@pytest.mark.parametrize("newest", STRAYS)
def test_e23_after_every_number_there_is_a_later_one(newest: int) -> None:
    assert is_later(after(newest, 123_456), newest % NUMBERS)
    assert 0 <= after(newest, 123_456) < NUMBERS


def test_e23_two_starts_at_the_same_wall_time_differ() -> None:
    """A machine without a clock battery begins at the same time with every boot."""
    assert drawn_at(1000, 3) != drawn_at(1000, 4)
    assert is_later(drawn_at(1001, 0), drawn_at(1000, 999))
    assert after(7, 3) != after(7, 4), "nor do two that were told of the same number take the same"


@pytest.mark.parametrize("robot_id", [2, 4])
def test_e24_a_follower_whose_gateway_saw_a_higher_term_makes_its_leader_raise_its_own(robot_id: int) -> None:
    """After a restart of all under clocks set back, only that gateway remembers how far terms had come."""
    team = Team()
    far = Term(10**12, 9, 9)
    team.gateways[robot_id].gateway.term_max = far
    team.run(1.0 + SETTLED_S)
    assert team.leaders() == [1]
    assert team.lease_of(1).term > far
    assert team.gateways[robot_id].gateway.term_max == team.lease_of(1).term, "it lets the robot's commands through"
    assert team.safe()


def test_e24_a_learner_is_heard_as_well() -> None:
    team = Team(robots=9, led_by=3.0)
    assert team.lease_of(9).me not in team.lease_of(1).config.voters
    far = Term(10**12, 9, 9)
    team.gateways[9].gateway.term_max = far
    team.run(3.0 + SETTLED_S)
    assert team.gateways[9].gateway.term_max == team.lease_of(1).term > far
    assert team.safe()


def test_ids_without_end_take_no_memory_without_end() -> None:
    peers = FailureDetector(Member(1, 1), 0.1)
    for n in range(2, 3 * IDS_MAX):
        peers.appeared(n, 1)
        peers.heard(Member(n, 1), 0.0)
        peers.vanished(n, 1, 0.0)
    assert max(len(peers._newest), len(peers._tokens), len(peers._gone)) <= IDS_MAX
    assert peers.is_gone(Member(2, 1))
    peers.appeared(2, 1)
    assert not peers.is_gone(Member(2, 1)), "those that are known are still heard"
