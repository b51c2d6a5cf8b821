"""Who leads first, and who after a leader that is gone: one rule or one usual bug a test."""

from __future__ import annotations

import pytest
from msgspec import structs

from lfa.deploy.fuzz.lease_simulation import LeaseSimulation
from lfa.protocol.lease.effects import BecomeLeader
from lfa.protocol.lease.election import COLD_START_S, Election
from lfa.protocol.lease.failure_detector import FailureDetector
from lfa.protocol.lease.machine.lease import Lease
from lfa.protocol.lease.membership import first_config
from lfa.protocol.messages.consensus import Config, Hello, Member, Prepare, Propose, Release, Term, Version
from lfa.protocol.mission import Leading, Mission
from lfa.protocol.transport.link_model import Radio
from tests.rigs.lease_scenes import STD, Team, sent


def test_e5_whatever_the_order_of_starting_the_head_of_the_chain_leads_first() -> None:
    team = LeaseSimulation(4, seed=3)
    for robot_id in team.mission.robots:
        team.start_gateway(robot_id, -1.0)
    for at, robot_id in ((0.0, 4), (0.3, 2), (0.9, 0), (1.4, 3), (2.0, 1)):
        team.at(at, team.start, robot_id)
    team.run(4.0)
    assert team.leaders() == [1]
    assert team.lease_of(3).chain == (1, 2, 3, 4)


@pytest.mark.parametrize("seed", range(4))
def test_e5_twelve_that_start_at_once_on_a_busy_machine_do_not_undo_each_others_promises(seed: int) -> None:
    """Half of the messages come late, by 0.2 s in the mean: longer than two heartbeats."""
    team = LeaseSimulation(12, seed=seed, radio=Radio(0.01, 0.05, tail=0.5, tail_mean_s=0.2)).start_all()
    team.run(2.0)
    assert team.leaders() == [1]


def test_e18_a_fleet_that_nobody_remembers_waits_for_everybody() -> None:
    team = LeaseSimulation(4, seed=3)
    for robot_id in team.mission.robots:
        team.start_gateway(robot_id, -1.0)
    for robot_id in (0, 2, 3, 4):
        team.at(0.0, team.start, robot_id)
    team.run(8.0)
    assert team.leaders() == []
    assert team.lease_of(2).missing == (1,)
    team.start(1)
    team.run(9.0)
    assert team.leaders() == [1]
    assert team.lease_of(2).missing == ()


def test_e18_a_life_that_promised_and_was_replaced_makes_no_full_house() -> None:
    """It cannot accept the fresh config: counted in, it would hold everybody for T_act (seed 16062)."""
    team = LeaseSimulation(4, seed=3)
    team.step_wall(1, 3600.0)  # terms of 1 are above all that a later life of 2 starts with, and refuses
    for robot_id in team.mission.robots:
        team.start_gateway(robot_id, -1.0)
    for robot_id in (0, 1, 2, 3):
        team.at(0.0, team.start, robot_id)
    team.run(2.0)
    team.kill(2, hinted=False)
    team.start(4)
    team.run(2.1)
    team.start(2)
    team.run(2.1 + STD.grant_s + 3.0 * STD.heartbeat_s)
    assert team.leaders() == [1]


@pytest.mark.parametrize("seed", range(5))
def test_l6_after_a_silent_death_of_the_leader_the_next_in_the_chain_leads_within_its_bond(seed: int) -> None:
    team = Team(seed=seed)
    team.kill(1, hinted=False)
    team.run(2.0)
    assert team.leaders() == [2]
    assert team.led_at(1.0) - 1.0 <= STD.grant_s + 4 * STD.rank_step_s
    assert team.lease_of(4).chain == (2, 3, 4)
    assert team.safe()


def test_e6_a_place_in_the_order_follows_the_tokens_that_vanish_and_come_back() -> None:
    mission = Mission(robots=(1, 2, 3, 4), leading=Leading(route_m=((1.0, 0.0),)))
    me, config = Member(4, 1), structs.replace(first_config(mission), version=Version(Term(7), 0))
    election, peers = Election(me, mission, STD, 0.0), FailureDetector(me, STD.heartbeat_s)

    def place() -> int:
        election.after(0.0, config, peers)
        return round(election.at / STD.rank_step_s)

    assert place() == 2  # behind 2 and 3; 1 is the lost leader
    peers.vanished(2, 0, 1.0)
    assert place() == 1
    peers.appeared(2, 1)
    assert place() == 2


def test_e6_the_election_passes_over_those_that_may_not_lead() -> None:
    mission = Mission(robots=(1, 2, 3, 4), can_lead=(1, 4), leading=Leading(route_m=((1.0, 0.0),)))
    team = Team(mission=mission)
    team.kill(1)
    team.run(2.0)
    assert team.leaders() == [4]
    assert team.lease_of(2).chain == (4, 2, 3)


def test_bug_8_terms_grow_over_a_total_blackout() -> None:
    team = Team()
    team.kill(1)
    team.start(1)
    team.run(2.0)
    before = team.lease_of(2).term
    for robot_id in team.ids:
        team.kill(robot_id)
    for robot_id in team.mission.robots:
        team.start_gateway(robot_id)
    for robot_id in team.ids:
        team.start(robot_id)
    team.run(4.0)
    assert team.leaders() == [1]
    assert team.lease_of(1).term > before
    assert team.safe()


def test_bug_10_an_isolated_follower_that_returns_deposes_nobody() -> None:
    team = Team()
    before = team.lease_of(1).term
    team.cut((3,))
    team.run(11.0)
    team.heal()
    team.run(13.0)
    assert team.changes() in ([], [(1, "BecomeLeader")]), "only the leader's own term may have been raised"
    assert team.lease_of(1).term.n <= before.n + 2, "ten seconds alone must not drive the terms up"
    assert team.lease_of(3).chain == (1, 2, 4, 3)


@pytest.mark.parametrize("seed", range(5))
def test_bug_12_sixteen_that_start_at_once_agree_on_one_leader(seed: int) -> None:
    team = LeaseSimulation(16, seed=seed)
    team.start_all().run(STD.grant_s + 4 * STD.rank_step_s * 16)
    assert team.leaders() == [1]


def test_e6_a_robot_without_a_vote_does_not_wait_for_a_lease_that_was_released() -> None:
    """It was bound to nobody, but knows the leader's term from the PROPOSEs."""
    mission = Mission(robots=(1, 2), leading=Leading(route_m=((1.0, 0.0),)))
    term, leader, witness = Term(5, 1, 7), Member(1, 7), Member(0, 3)
    config = Config(Version(term, 0), (leader, Member(2, 4), witness), witness, None, (leader,))
    newcomer = Lease(Member(2, 9), mission, STD, 0.0, floor=0)
    newcomer.receive(leader, Propose(term, config, 3, leader, agreed=newcomer.agreed), 10.0)
    newcomer.receive(leader, Release(term), 10.01)
    now, asked = 10.01, []
    while not asked and now < 11.0:
        now = max(newcomer.next_deadline(), now + 1e-6)
        asked = sent(newcomer.tick(now), Prepare)
    assert now <= 10.01 + 4 * STD.rank_step_s * 2


def _under_a_leader(*chain: Member) -> Lease:
    """Robot 2, which voted for robot 1 at 10 s; the leader's chain is robot 1 and `chain`."""
    mission = Mission(robots=(1, 2), leading=Leading(route_m=((1.0, 0.0),)))
    term, leader, witness = Term(5, 1, 7), Member(1, 7), Member(0, 3)
    config = Config(Version(term, 0), (leader, Member(2, 4), witness), witness, None, (leader, *chain))
    lease = Lease(Member(2, 4), mission, STD, 0.0, floor=0)
    lease.receive(leader, Propose(term, config, 3, leader, agreed=lease.agreed), 10.0)
    lease.tick(10.0)
    return lease


def test_e9_who_looks_in_soon_is_woken_for_a_hello_only_when_it_has_one_to_say() -> None:
    follower, out = _under_a_leader(Member(2, 4)), _under_a_leader()
    hello_at = out.next_deadline()
    assert follower.next_deadline() == hello_at, "without control steps of its own nobody else asks"
    assert follower.next_deadline(hello_at + 0.02) > hello_at
    assert out.next_deadline(hello_at + 0.02) == hello_at


def test_e9_hellos_keep_their_beat_when_a_look_comes_late() -> None:
    out = _under_a_leader()
    first = out.next_deadline()
    assert sent(out.tick(first + 0.015), Hello)
    assert out.next_deadline() - first == pytest.approx(first - 10.0)


def test_followers_that_leave_stay_out_of_the_election() -> None:
    team = Team()
    team.exit(2)
    team.run(1.2)
    assert not team.processes[2].alive
    assert team.lease_of(3).chain == (1, 3, 4)


MAJORITY = Mission(robots=(1, 2, 3, 4), cold_start="majority", leading=Leading(route_m=((1.0, 0.0),)))


def started(*ids: int, mission: Mission) -> LeaseSimulation:
    """Only these processes, for six seconds."""
    leases = LeaseSimulation(4, mission=mission)
    for robot_id in ids:
        leases.start(robot_id)
    leases.run(6.0)
    return leases


def test_e19_a_majority_with_the_witness_starts_after_its_patience_and_latecomers_join() -> None:
    leases = started(0, 1, 2, mission=MAJORITY)
    assert leases.leaders() == [1]
    assert next(at for at, _, effect in leases.log if isinstance(effect, BecomeLeader)) >= COLD_START_S
    leases.start(3)
    leases.start(4)
    leases.run(10.0)
    assert leases.leaders() == [1]
    assert leases.lease_of(4).chain[:2] == (1, 2)
    assert sorted(leases.lease_of(4).chain) == [1, 2, 3, 4]


def test_e19_needs_the_witness_and_more_than_half() -> None:
    assert started(1, 2, 3, mission=MAJORITY).leaders() == []
    assert started(0, 1, mission=MAJORITY).leaders() == []


def test_e19_is_not_for_a_full_house_team() -> None:
    assert (
        started(0, 1, 2, 3, mission=Mission(robots=(1, 2, 3, 4), leading=Leading(route_m=((1.0, 0.0),)))).leaders()
        == []
    )


def test_e19_a_promiser_that_remembers_a_config_forbids_it() -> None:
    """Two of four die, and the two that are left with the witness lose their memory but for one."""
    team = Team(mission=MAJORITY)
    for victim in (0, 1, 2, 3):
        team.kill(victim)
    for victim in (0, 1):
        team.start(victim)
    team.run(9.0)
    assert team.leaders() == []
    assert team.safe()
