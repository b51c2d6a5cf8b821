"""The timed lease core, one rule or one usual bug a test. Directed scenarios in virtual time."""

from __future__ import annotations

from itertools import pairwise

import pytest

from deploy.look.checker import Checker
from deploy.look.checkers import SAFETY
from deploy.look.liveness import Steady
from deploy.run.arena import Arena
from deploy.run.chaos import play
from deploy.run.network import Weather
from deploy.run.schedules import Schedule
from protocol.acceptor import Acceptor
from protocol.effects import BecomeLeader, Effect, LeaseExtended, Send, StepDown
from protocol.election import COLD_START_S
from protocol.lease import Lease
from protocol.membership import first_config
from protocol.messages import (
    Config,
    Grant,
    Hello,
    LeaseBody,
    Member,
    Nack,
    Prepare,
    Promise,
    Propose,
    Release,
    Role,
    Term,
    Version,
)
from protocol.mission import Leading, Mission
from protocol.timing import timing_of

STD = timing_of("std")
TEAM = Mission(robots=(1, 2, 3, 4), leading=Leading(route_m=((1.0, 0.0),)))


class Team(Arena):
    """An arena whose safety checkers are on, with everybody started and led by robot 1 at 1 s, or at `led_by`."""

    def __init__(self, robots: int = 4, led_by: float = 1.0, **options: object) -> None:
        super().__init__(robots, **options)  # type: ignore[arg-type]
        self.checkers: list[Checker] = [checker(self.timing) for checker in SAFETY]
        self.listen(self.checkers)
        self.start_all().run(led_by)
        assert self.leaders() == [1]

    def safe(self) -> bool:
        found = [v for checker in self.checkers for v in checker.violations]
        assert not found, found
        return True

    def changes(self, since: float = 1.0) -> list[tuple[int, str]]:
        """Who became leader or stepped down since then."""
        return [(who, type(effect).__name__) for at, who, effect in self.log if at > since]

    def led_at(self, since: float) -> float:
        """When somebody first became leader after `since`."""
        return next(at for at, _, effect in self.log if at > since and isinstance(effect, BecomeLeader))


def config_of(term: Term, seq: int = 0) -> Config:
    """Four robots and the witness, in their first lives."""
    chain = tuple(Member(i, 1) for i in TEAM.robots)
    tie = Member(0, 1)
    return Config(Version(term, seq), (*chain, tie), tie, None, chain)


OLD = config_of(Term(1, 1, 1))


def voter(now: float = 10.0) -> Acceptor:
    """One that has been up for long."""
    return Acceptor(Term(), STD.grant_s, now - 1.0)


def ask(voter: Acceptor, who: Member, term: Term, now: float, number: int = 0) -> Grant | Nack | None:
    return voter.propose(who, Propose(term, config_of(term), number, who), OLD, now)


A, B = Member(1, 7), Member(2, 8)
LOW, HIGH = Term(5, 1, 7), Term(6, 2, 8)


# --- the voter -----------------------------------------------------------------------------------------------


def test_e1_a_process_that_starts_promises_nothing_for_the_longest_bond() -> None:
    fresh, blank = Acceptor(Term(), STD.grant_s, 10.0), first_config(TEAM)
    soon, later = 10.0 + STD.grant_s - 0.001, 10.0 + STD.grant_s
    assert fresh.prepare(A, Prepare(LOW, Version()), blank, soon) is None
    promise = fresh.prepare(A, Prepare(LOW, Version()), blank, later)
    assert isinstance(promise, Promise)
    assert promise.blank


def test_e1_promises_of_a_new_life_are_above_its_floor() -> None:
    fresh = Acceptor(Term(100), STD.grant_s, 0.0)
    assert isinstance(ask(fresh, A, Term(99, 1, 7), 10.0), Nack)
    assert isinstance(ask(fresh, A, Term(100, 1, 7), 10.0), Grant)


def test_e3_a_bound_voter_refuses_another_holder_and_tells_when_it_is_free() -> None:
    bound = voter()
    ask(bound, A, LOW, 10.0)
    refusal = ask(bound, B, HIGH, 10.1)
    assert isinstance(refusal, Nack)
    assert refusal.holder == A
    assert refusal.remaining_s == pytest.approx(STD.grant_s - 0.1)
    assert isinstance(ask(bound, B, HIGH, 10.0 + STD.grant_s), Grant)


def test_e3_refusing_a_candidate_changes_nothing_at_a_bound_voter() -> None:
    bound = voter()
    ask(bound, A, LOW, 10.0)
    assert isinstance(bound.prepare(B, Prepare(HIGH, Version(HIGH)), config_of(LOW), 10.1), Nack)
    assert isinstance(ask(bound, A, LOW, 10.1, 1), Grant), "the holder could not renew after a refused candidate"


def test_e3_the_holder_may_raise_its_own_term() -> None:
    bound = voter()
    ask(bound, A, LOW, 10.0)
    raised = Term(9, 1, 7)
    assert isinstance(bound.prepare(A, Prepare(raised, Version(LOW)), config_of(LOW), 10.1), Promise)
    assert isinstance(ask(bound, A, raised, 10.1), Grant)


def test_e3_what_was_promised_is_kept() -> None:
    free = voter()
    free.prepare(B, Prepare(HIGH, OLD.version), OLD, 10.0)
    assert isinstance(ask(free, A, LOW, 10.1), Nack)


def test_e3_a_fenced_term_binds_no_more_but_another_still_does() -> None:
    bound = voter()
    ask(bound, A, LOW, 10.0)
    wrong = Propose(HIGH, config_of(HIGH), 0, B, fenced=(Term(4, 1, 7),))
    assert isinstance(bound.propose(B, wrong, config_of(LOW), 10.1), Nack)
    right = Propose(HIGH, config_of(HIGH), 0, B, fenced=(LOW,))
    assert isinstance(bound.propose(B, right, config_of(LOW), 10.1), Grant)


def test_e4_a_voter_promises_nothing_up_to_a_released_term_and_says_what_beats_it() -> None:
    """Promised and then refused, a team that has forgotten the released term would elect for ever (seed 31389)."""
    free = voter()
    free.release(HIGH)
    refusal = free.prepare(A, Prepare(LOW, OLD.version), OLD, 10.0)
    assert isinstance(refusal, Nack)
    assert refusal.promised == HIGH


def test_e4_a_release_frees_the_bond_of_exactly_its_term() -> None:
    bound = voter()
    ask(bound, A, LOW, 10.0)
    assert not bound.release(Term(4, 1, 7))
    assert isinstance(ask(bound, B, HIGH, 10.1), Nack)
    assert bound.release(LOW)
    assert isinstance(ask(bound, B, HIGH, 10.2), Grant)


def test_bug_14_a_late_propose_does_not_bring_a_released_lease_back() -> None:
    bound = voter()
    ask(bound, A, LOW, 10.0)
    bound.release(LOW)
    assert isinstance(ask(bound, A, LOW, 10.1, 1), Nack)


def test_a_voter_refuses_a_config_older_than_its_own() -> None:
    free = voter()
    newer = config_of(HIGH, 3)
    refusal = free.prepare(A, Prepare(Term(9, 1, 7), Version(HIGH, 2)), newer, 10.0)
    assert isinstance(refusal, Nack)
    assert refusal.config == newer


# --- lease time ------------------------------------------------------------------------------------------------


def alone() -> Lease:
    """Robot 1 of two with a witness; it has heard the others."""
    mission = Mission(robots=(1, 2), leading=Leading(route_m=((1.0, 0.0),)))
    lease = Lease(Member(1, 7), mission, STD, 0.0, floor=0)
    for other in OTHERS:
        lease.receive(other, Hello(None), 0.0)
    return lease


OTHERS = (Member(0, 3), Member(2, 4))


def sent(effects: list[Effect], kind: type) -> list[LeaseBody]:
    return [e.body for e in effects if isinstance(e, Send) and isinstance(e.body, kind)]


def proposed(lease: Lease, at: float) -> Propose:
    """What it proposes when both others promise at `at`."""
    [prepare] = sent(lease.tick(STD.grant_s), Prepare)
    assert isinstance(prepare, Prepare)
    promise = Promise(prepare.term, lease.config, None, True)
    effects = [e for other in OTHERS for e in lease.receive(other, promise, at)]
    [propose] = sent(effects, Propose)
    assert isinstance(propose, Propose)
    return propose


def elected(slow_s: float) -> tuple[Lease, float, float, list[Effect]]:
    """Robot 1 asked at `asked_at`; the others' grants came `slow_s` later."""
    lease, asked_at = alone(), STD.grant_s + 0.001
    propose = proposed(lease, asked_at)
    at = asked_at + slow_s
    grant = Grant(propose.term, propose.round, propose.config.version, 0.0)
    effects = [e for other in OTHERS for e in lease.receive(other, grant, at)]
    return lease, asked_at, at, effects


def test_e2_bug_1_the_lease_runs_from_when_it_was_asked_for_not_from_the_grant() -> None:
    lease, asked_at, at, effects = elected(slow_s=0.035)
    [become] = [e for e in effects if isinstance(e, BecomeLeader)]
    assert become.expiry == asked_at + STD.act_s
    assert lease.may_command(at)
    assert not lease.may_command(asked_at + STD.act_s)


def test_e2_bug_1_a_renewal_counts_from_its_round_not_from_the_grants() -> None:
    lease, _, _, _ = elected(slow_s=0.001)
    asked_at = lease.next_deadline()
    [propose] = sent(lease.tick(asked_at), Propose)
    assert isinstance(propose, Propose)
    grant = Grant(propose.term, propose.round, propose.config.version, 0.0)
    effects = [e for other in OTHERS for e in lease.receive(other, grant, asked_at + 0.035)]
    assert [e.expiry for e in effects if isinstance(e, LeaseExtended)] == [asked_at + STD.act_s], (
        "counted from the grants, the voters would be free before the lease ends (I1)"
    )


def test_bug_6_leadership_is_announced_only_with_the_quorums_grants() -> None:
    lease = alone()
    propose = proposed(lease, STD.grant_s)
    assert lease.role is not Role.LEADER
    grant = Grant(propose.term, propose.round, propose.config.version, 0.0)
    effects = lease.receive(OTHERS[0], grant, STD.grant_s)
    assert not any(isinstance(e, BecomeLeader) for e in effects), "in a full house everybody must grant"
    assert lease.role is not Role.LEADER


def test_e2_a_grant_that_comes_after_the_lease_would_have_run_out_makes_no_leader() -> None:
    lease, _, _, effects = elected(slow_s=STD.act_s + 0.001)
    assert not any(isinstance(e, BecomeLeader) for e in effects)
    assert lease.role is not Role.LEADER


def test_e7_bug_5_at_the_lease_end_it_stops_before_anything_else() -> None:
    lease, asked_at, _, _ = elected(slow_s=0.001)
    effects = lease.receive(Member(2, 4), Hello(Version()), asked_at + STD.act_s)
    assert isinstance(effects[0], StepDown)
    assert not lease.may_command(asked_at + STD.act_s)
    assert not sent(effects, Propose), "a leader whose lease has run out must fall silent"


def test_e4_the_release_waits_for_the_own_gateway() -> None:
    team = Team()
    team.filter = lambda src, to, body: None if to == -1 else 0.0  # the gateway's link is dead
    last = [at for at, _ in team.accepted][-1]
    team.exit(1)
    assert not team.lease_of(1).released
    team.run(1.0 + STD.deadman_s * 2)
    assert team.lease_of(1).released
    assert team.led_at(1.0) >= last + STD.deadman_s * 0.99
    assert team.safe()


# --- the team --------------------------------------------------------------------------------------------------


def test_e5_whatever_the_order_of_starting_the_head_of_the_chain_leads_first() -> None:
    team = Arena(4, seed=3)
    for robot_id in team.mission.robots:
        team.start_gateway(robot_id, -1.0)
    for at, robot_id in ((0.0, 4), (0.3, 2), (0.9, 0), (1.4, 3), (2.0, 1)):
        team.at(at, team.start, robot_id)
    team.run(4.0)
    assert team.leaders() == [1]
    assert team.lease_of(3).chain == (1, 2, 3, 4)


def test_e18_a_fleet_that_nobody_remembers_waits_for_everybody() -> None:
    team = Arena(4, seed=3)
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
    team = Arena(4, seed=3)
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


def test_l5_a_pair_without_witness_keeps_its_leader_at_a_fifth_of_all_messages_lost() -> None:
    """Each round needs both of two messages: sent once a heartbeat only, a third of such leaders fell within 8 s."""
    for seed in range(10):
        schedule = Schedule(seed, 2, False, "std", False, {}, (), Weather(delay_max=0.005, loss=0.2), False)
        assert play(schedule).violations == [], f"of draw {seed}"


@pytest.mark.parametrize("seed", range(5))
def test_l6_after_a_silent_death_of_the_leader_the_next_in_the_chain_leads_within_its_bond(seed: int) -> None:
    team = Team(seed=seed)
    team.kill(1, hinted=False)
    team.run(2.0)
    assert team.leaders() == [2]
    assert team.led_at(1.0) - 1.0 <= STD.grant_s + 4 * STD.rank_step_s
    assert team.lease_of(4).chain == (2, 3, 4)
    assert team.safe()


def test_e6_the_election_passes_over_those_that_may_not_lead() -> None:
    mission = Mission(robots=(1, 2, 3, 4), can_lead=(1, 4), leading=Leading(route_m=((1.0, 0.0),)))
    team = Team(mission=mission)
    team.kill(1)
    team.run(2.0)
    assert team.leaders() == [4]
    assert team.lease_of(2).chain == (4, 2, 3)


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


def test_e10_a_raised_term_interrupts_nobody() -> None:
    team = Team()
    team.gateways[1].gateway.term_max = Term(team.lease_of(1).term.n, 9, 9)  # a fence whose candidate died
    team.run(1.5)
    assert team.changes() == [(1, "BecomeLeader")]
    times = [at for at, _ in team.accepted if at > 1.1]
    assert max(b - a for a, b in pairwise(times)) < STD.deadman_s


@pytest.mark.parametrize("gateways_at_world", [False, True])
def test_l7_a_leader_that_is_cut_off_commands_no_more_after_its_lease(gateways_at_world: bool) -> None:
    team = Team(gateways_at_world=gateways_at_world)
    team.cut((1,))
    team.run(3.0)
    by_1 = [at for at, cmd in team.accepted if cmd.holder == 1]
    assert by_1[-1] <= 1.0 + STD.act_s + STD.deadman_s
    assert team.leaders() == [2]
    assert team.safe()


def test_bug_4_the_command_of_a_zombie_is_refused() -> None:
    team = Team()
    team.pause(1)
    team.run(2.0)
    assert team.leaders() == [2]
    team.resume(1)
    team.run(2.1)
    refused = team.gateways[1].gateway.refused
    assert refused == {"old_stamp": 1}
    assert team.safe()


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


def test_bug_11_a_deaf_leader_does_not_keep_its_voters_bound() -> None:
    team = Team()
    team.cuts |= {(other, 1) for other in (0, 2, 3, 4)}
    team.run(1.0 + STD.grant_s + STD.act_s + 4 * STD.rank_step_s + 0.05)
    assert team.leaders() == [2]
    assert team.safe()


@pytest.mark.parametrize("seed", range(5))
def test_bug_12_sixteen_that_start_at_once_agree_on_one_leader(seed: int) -> None:
    team = Arena(16, seed=seed)
    team.start_all().run(STD.grant_s + 4 * STD.rank_step_s * 16)
    assert team.leaders() == [1]


@pytest.mark.parametrize("loss", [0.1, 0.2])
def test_l5_bug_15_loss_changes_neither_holder_nor_chain(loss: float) -> None:
    team = Team()
    team.weather.loss = loss
    version = team.lease_of(1).config.version
    team.run(21.0)
    assert team.changes() == []
    assert team.lease_of(1).config.version == version


def test_l5_in_ten_minutes_at_20_percent_loss_the_holder_never_changes() -> None:
    team = Arena(4, seed=5)
    steady = Steady(team.timing)
    team.start_all().run(1.0)
    team.listen([steady])
    team.weather.loss = 0.2
    team.run(601.0)
    assert steady.violations == []
    assert team.leaders() == [1]


def test_after_a_release_the_next_leads_within_two_round_trips() -> None:
    team = Team()
    team.exit(1)
    team.run(2.0)
    assert team.leaders() == [2]
    assert team.led_at(1.0) - 1.0 < 0.02
    assert team.lease_of(3).chain == (2, 3, 4)
    assert team.safe()


def test_e6_a_robot_without_a_vote_does_not_wait_for_a_lease_that_was_released() -> None:
    """It was bound to nobody, but knows the leader's term from the PROPOSEs."""
    mission = Mission(robots=(1, 2), leading=Leading(route_m=((1.0, 0.0),)))
    term, leader, witness = Term(5, 1, 7), Member(1, 7), Member(0, 3)
    config = Config(Version(term, 0), (leader, Member(2, 4), witness), witness, None, (leader,))
    newcomer = Lease(Member(2, 9), mission, STD, 0.0, floor=0)
    newcomer.receive(leader, Propose(term, config, 3, leader), 10.0)
    newcomer.receive(leader, Release(term), 10.01)
    now, asked = 10.01, []
    while not asked and now < 11.0:
        now = max(newcomer.next_deadline(), now + 1e-6)
        asked = sent(newcomer.tick(now), Prepare)
    assert now <= 10.01 + 4 * STD.rank_step_s * 2


def test_a_release_does_not_revive_the_voters_old_promise() -> None:
    assert not voter().release(LOW)


def test_followers_that_leave_stay_out_of_the_election() -> None:
    team = Team()
    team.exit(2)
    team.run(1.2)
    assert not team.processes[2].alive
    assert team.lease_of(3).chain == (1, 3, 4)


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


# --- fence, then elect -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(10))
def test_e15_after_a_kill_the_next_leads_within_the_hint_and_three_round_trips(seed: int) -> None:
    team = Team(seed=seed)
    team.kill(1)
    team.run(2.0)
    assert team.leaders() == [2]
    assert team.led_at(1.0) - 1.0 < 0.04
    assert team.lease_of(4).chain == (2, 3, 4)
    assert team.safe()


def test_e15_two_that_die_together_leave_the_third_to_lead() -> None:
    team = Team(6)
    team.kill(1)
    team.kill(2)
    team.run(2.0)
    assert team.leaders() == [3]
    assert team.led_at(1.0) - 1.0 < 0.1
    assert team.safe()


def test_e15_bug_13_a_false_hint_to_all_never_makes_two_that_act() -> None:
    team = Team()
    team.hint(1, 0, 2, 3, 4)
    team.run(2.0)
    assert len(team.leaders()) == 1
    assert team.safe()


def test_e15_a_false_hint_to_one_changes_no_holder() -> None:
    team = Team()
    team.hint(1, 2)
    team.run(2.0)
    assert team.leaders() == [1]
    assert all(who == 1 and what == "BecomeLeader" for who, what in team.changes())
    assert team.safe()


def test_e15_when_the_gateway_cannot_be_reached_the_bond_is_waited_out() -> None:
    team = Team()
    team.filter = lambda src, to, body: None if to == -1 else 0.0
    team.kill(1)
    team.run(2.0)
    assert team.leaders() == [2]
    assert team.led_at(1.0) - 1.0 >= STD.grant_s - STD.heartbeat_s
    assert team.safe()


def test_e15_a_candidate_that_overtakes_the_hint_is_answered_when_it_comes() -> None:
    bound = voter()
    ask(bound, A, LOW, 10.0)
    refusal = bound.prepare(B, Prepare(HIGH, Version(HIGH)), config_of(LOW), 10.1)
    assert isinstance(refusal, Nack)
    promise = bound.prepare(B, Prepare(HIGH, Version(HIGH)), config_of(LOW), 10.1, holder_gone=True)
    assert isinstance(promise, Promise)
    assert promise.needs_fence is not None
    assert (promise.needs_fence.term, promise.needs_fence.holder) == (LOW, A)


# --- handing over ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(10))
def test_e16_a_hand_over_takes_one_round_trip_and_the_giver_goes_to_the_tail(seed: int) -> None:
    team = Team(seed=seed)
    team.hand_over(1)
    team.run(2.0)
    assert team.leaders() == [2]
    assert team.led_at(1.0) - 1.0 < 0.008
    assert team.lease_of(3).chain == (2, 3, 4, 1)
    assert team.safe()


def test_e16_a_hand_over_to_one_that_just_died_ends_in_an_election() -> None:
    team = Team()
    team.kill(2, hinted=False)
    team.hand_over(1)
    team.run(2.0)
    assert team.leaders() == [3]
    assert team.safe()


def test_e16_a_second_copy_of_a_hand_over_changes_nothing() -> None:
    team = Team()
    team.weather.duplicate, team.weather.tail_mean = 1.0, 0.2
    team.hand_over(1)
    team.run(3.0)
    assert team.leaders() == [2]
    assert team.changes() == [(2, "BecomeLeader")]
    assert team.safe()


def test_e16_the_last_robot_has_nobody_to_hand_over_to_and_leads_again() -> None:
    team = Team(1)
    team.hand_over(1)
    team.run(3.0)
    assert team.leaders() == [1]
    assert team.safe()


# --- members that come and go ------------------------------------------------------------------------------------


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


MAJORITY = Mission(robots=(1, 2, 3, 4), cold_start="majority", leading=Leading(route_m=((1.0, 0.0),)))


def started(*ids: int, mission: Mission) -> Arena:
    """Only these processes, for six seconds."""
    arena = Arena(4, mission=mission)
    for robot_id in ids:
        arena.start(robot_id)
    arena.run(6.0)
    return arena


def test_e19_a_majority_with_the_witness_starts_after_its_patience_and_latecomers_join() -> None:
    arena = started(0, 1, 2, mission=MAJORITY)
    assert arena.leaders() == [1]
    assert next(at for at, _, effect in arena.log if isinstance(effect, BecomeLeader)) >= COLD_START_S
    arena.start(3)
    arena.start(4)
    arena.run(10.0)
    assert arena.leaders() == [1]
    assert arena.lease_of(4).chain[:2] == (1, 2)
    assert sorted(arena.lease_of(4).chain) == [1, 2, 3, 4]


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


# --- by an operator's word, or alone -----------------------------------------------------------------------------


def blacked_out(*remembering: int, off: tuple[int, ...] = (4,)) -> Team:
    """Everybody has lost its memory but for those `remembering`, and `off` stay off."""
    team = Team()
    for robot_id in team.ids:
        if robot_id not in remembering:
            team.kill(robot_id)
    for robot_id in team.ids:
        if robot_id not in (*remembering, *off):
            team.start(robot_id)
    team.run(4.0)
    assert team.leaders() == []
    return team


def test_e20_a_fleet_that_lost_its_memory_goes_on_without_whom_the_operator_declares_dead() -> None:
    team = blacked_out(3)
    lost = team.processes[4].member
    team.forget(lost)
    team.run(5.0)
    assert len(team.leaders()) == 1
    assert sorted(team.lease_of(3).chain) == [1, 2, 3]
    team.start(4)
    team.run(7.0)
    assert team.lease_of(3).chain[-1] == 4, "a later life of it joins as anybody does"
    assert team.safe()


def test_e20_several_may_be_forgotten_at_once() -> None:
    team = blacked_out(3, off=(1, 2, 4))
    team.forget(*(team.processes[i].member for i in (1, 2, 4)))
    team.run(5.0)
    assert team.leaders() == [3]
    assert team.safe()


def test_e20_the_word_holds_for_one_attempt() -> None:
    """Robot 2 is off as well, and comes when the attempt is over: then robot 4 is needed again."""
    team = blacked_out(3, off=(2, 4))
    team.forget(team.processes[4].member)
    team.run(6.0)
    assert team.leaders() == []
    team.start(2)
    team.run(9.0)
    assert team.leaders() == []
    assert team.safe()


def test_e20_whoever_heard_a_later_life_of_it_refuses() -> None:
    team = blacked_out(3)
    dead = team.processes[4].member
    team.start(4)
    team.run(4.1)
    team.cut((4,))
    team.forget(dead)
    team.run(7.0)
    assert team.leaders() == []
    assert team.safe()


def test_e20_nobody_is_forgotten_where_somebody_leads() -> None:
    team = Team()
    team.forget(team.processes[4].member)
    team.run(2.0)
    assert team.changes() == []
    assert team.lease_of(2).chain == (1, 2, 3, 4)


LONELY = Mission(
    robots=(1, 2, 3, 4), lonely="continue_after", continue_after_s=3.0, leading=Leading(route_m=((1.0, 0.0),))
)


def left_alone(mission: Mission = LONELY) -> Team:
    """Three of four die at once: no quorum is left."""
    team = Team(mission=mission, gateways_at_world=True)
    for victim in (1, 2, 3):
        team.kill(victim)
    team.run(3.9)
    assert team.leaders() == []
    return team


def test_e21_the_last_robot_goes_on_alone_when_all_other_gateways_refuse_what_is_below() -> None:
    team = left_alone()
    team.run(5.0)
    assert team.leaders() == [4]
    term = team.lease_of(4).term
    assert all(team.gateways[i].gateway.term_max == term for i in (1, 2, 3)), "each is fenced"
    for robot_id in (1, 2, 3):
        team.start(robot_id)
    team.run(8.0)
    assert team.leaders() == [4]
    assert sorted(team.lease_of(1).chain) == [1, 2, 3, 4]
    assert team.safe()


def test_e21_while_one_gateway_does_not_answer_it_stays_where_it_is() -> None:
    team = left_alone()
    team.kill_gateway(2)
    team.run(9.0)
    assert team.leaders() == []
    assert team.safe()


def test_e21_nobody_is_lonely_by_default() -> None:
    team = left_alone(TEAM)
    team.run(20.0)
    assert team.leaders() == []


def test_e21_two_without_a_quorum_go_on_together_and_make_one_chain_with_the_others_again() -> None:
    team = Team(mission=LONELY)  # each gateway with its robot: the parts cannot fence each other ...
    team.cut((3, 4))
    team.run(9.0)
    assert team.leaders() == [1], "... so those without a quorum stay"
    team.heal()
    team.run(12.0)
    assert sorted(team.lease_of(4).chain) == [1, 2, 3, 4]
    assert team.safe()


def test_e21_whom_a_voter_tells_of_a_lease_is_not_lonely() -> None:
    team = Team(mission=LONELY, gateways_at_world=True)
    team.cuts |= {(a, b) for a in (1, 2) for b in (3, 4)} | {(a, b) for a in (3, 4) for b in (1, 2)}
    team.run(9.0)
    assert team.leaders() == [1]
    assert {who for who, _ in team.changes()} <= {1}
    assert team.safe()
