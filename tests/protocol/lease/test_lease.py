"""The lease that is held, one rule or one usual bug a test: from when it counts, how it ends, what loss does to it."""

from __future__ import annotations

from itertools import pairwise

import pytest
from msgspec import structs

from lfa.deploy.analysis.verification.leadership import Steady
from lfa.deploy.fuzz.fault_injector import play
from lfa.deploy.fuzz.lease_simulation import LeaseSimulation
from lfa.deploy.fuzz.network import FAIR
from lfa.deploy.fuzz.schedules import Schedule
from lfa.protocol.lease.effects import BecomeLeader, LeaseExtended, StepDown
from lfa.protocol.messages.consensus import Grant, Hello, Member, Propose, Role, Term, Version
from tests.rigs.lease_scenes import LOW, OTHERS, STD, Team, alone, elected, proposed, sent, voter


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


def test_e2_the_round_is_asked_for_in_the_step_before_it_is_due() -> None:
    """A leader with control steps, each a little late, is woken by them alone, and asks in every second one."""
    lease, asked_at, _, _ = elected(slow_s=0.001)
    step_s = STD.heartbeat_s / 2.0
    asked = []
    for n in range(1, 9):
        now, again_at = asked_at + 0.007 + n * step_s + 0.0004 * (n % 3), asked_at + 0.007 + (n + 1) * step_s
        rounds = sent(lease.tick(now, again_at), Propose)
        for propose in rounds:
            assert isinstance(propose, Propose)
            grant = Grant(propose.term, propose.round, propose.config.version, 0.0)
            for other in OTHERS:
                lease.receive(other, grant, now + 0.001)
        asked += [n] * len(rounds)
        assert lease.next_deadline(again_at) >= again_at
    assert asked == [1, 3, 5, 7]


def test_e2_who_looks_in_less_often_than_rounds_are_due_is_woken_for_them() -> None:
    lease, asked_at, _, _ = elected(slow_s=0.001)
    due_at = lease.next_deadline()
    assert due_at == asked_at + STD.heartbeat_s
    assert lease.next_deadline(asked_at + 1.0) == due_at


def test_e2_who_steps_less_often_than_rounds_are_due_asks_once_a_heartbeat_no_more() -> None:
    """With steps longer than a heartbeat no round is sent early: the one after it would need a wake-up all the same."""
    lease, now, _, _ = elected(slow_s=0.001)
    step_s = 1.25 * STD.heartbeat_s
    asked, again_at = [now], now + step_s
    while len(asked) < 9:
        now = min(lease.next_deadline(again_at), again_at)
        again_at += step_s if now == again_at else 0.0
        for propose in sent(lease.tick(now, again_at), Propose):
            assert isinstance(propose, Propose)
            asked.append(now)
            for other in OTHERS:
                lease.receive(other, Grant(propose.term, propose.round, propose.config.version, 0.0), now)
    assert [later - before for before, later in pairwise(asked)] == pytest.approx([STD.heartbeat_s] * 8)


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
    effects = lease.receive(Member(2, 4), Hello(Version(), lease.agreed), asked_at + STD.act_s)
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


def test_l5_a_pair_without_witness_keeps_its_leader_at_a_fifth_of_all_messages_lost() -> None:
    """Each round needs both of two messages: sent once a heartbeat only, a third of such leaders fell within 8 s."""
    radio = structs.replace(FAIR, jitter_s=0.0047, loss=0.2)
    for seed in range(10):
        schedule = Schedule(seed, 2, False, "std", False, {}, (), radio, False)
        assert play(schedule).violations == [], f"of draw {seed}"


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


def test_bug_11_a_deaf_leader_does_not_keep_its_voters_bound() -> None:
    team = Team()
    team.part({(other, 1) for other in (0, 2, 3, 4)})
    team.run(1.0 + STD.grant_s + STD.act_s + 4 * STD.rank_step_s + 0.05)
    assert team.leaders() == [2]
    assert team.safe()


@pytest.mark.parametrize("loss", [0.1, 0.2])
def test_l5_bug_15_loss_changes_neither_holder_nor_chain(loss: float) -> None:
    team = Team()
    team.link_model.radio = structs.replace(FAIR, loss=loss)
    version = team.lease_of(1).config.version
    team.run(21.0)
    assert team.changes() == []
    assert team.lease_of(1).config.version == version


def test_l5_in_ten_minutes_at_20_percent_loss_the_holder_never_changes() -> None:
    team = LeaseSimulation(4, seed=5)
    steady = Steady(team.timing)
    team.start_all().run(1.0)
    team.listen([steady])
    team.link_model.radio = structs.replace(FAIR, loss=0.2)
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


def test_a_release_does_not_revive_the_voters_old_promise() -> None:
    assert not voter().release(LOW)
