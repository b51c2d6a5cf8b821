"""A leader's successor within milliseconds: after its death by a fence, from its own hand by a transfer_proposal."""

from __future__ import annotations

import pytest
from msgspec import structs

from lfa.deploy.fuzz.network import FAIR
from lfa.protocol.messages.consensus import Nack, Prepare, Promise, Version
from tests.rigs.lease_scenes import HIGH, LOW, STD, A, B, Team, ask, config_of, voter


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
    team.link_model.radio = structs.replace(FAIR, duplication=1.0, duplication_lag_s=0.4)
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
