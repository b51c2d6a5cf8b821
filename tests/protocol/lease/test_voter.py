"""The voter, one rule a test: what it promises and grants, to whom, and for how long."""

from __future__ import annotations

import pytest

from lfa.protocol.lease.acceptor import Acceptor
from lfa.protocol.lease.membership import first_config
from lfa.protocol.messages.consensus import Grant, Nack, Prepare, Promise, Propose, Term, Version
from tests.rigs.lease_scenes import HIGH, LOW, OLD, STD, TEAM, A, B, ask, config_of, voter


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
