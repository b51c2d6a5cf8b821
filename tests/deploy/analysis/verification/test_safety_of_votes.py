"""The checkers of proposals, promises and grants notice each breach of I3, I4, I7 and I9, and nothing beside it."""

from __future__ import annotations

from typing import Any

import pytest

from lfa.deploy.analysis.verification.lease_observer import report_effect
from lfa.deploy.analysis.verification.safety import (
    NoAmnesiacVote,
    OneAgreement,
    OneBond,
    OneHolder,
)
from lfa.protocol.lease.effects import Send
from lfa.protocol.messages.consensus import (
    Config,
    Electorate,
    Member,
    Promise,
    Term,
)
from tests.rigs.lease_facts import (
    FOUR,
    HIGH,
    LOW,
    MIDDLE,
    OLD,
    ONE,
    STD,
    TEAM,
    THREE,
    TWO,
    config,
    found,
    grant,
    propose,
)

# I3


def test_i3_a_term_is_held_by_one_and_proposed_by_it_or_its_issuer() -> None:
    checker = OneHolder(STD)
    checker.proposes(0.0, ONE, propose(LOW, ONE))
    checker.proposes(0.0, ONE, propose(LOW, ONE))
    checker.proposes(0.0, TWO, propose(MIDDLE, THREE))  # hands over
    checker.proposes(0.0, THREE, propose(MIDDLE, THREE))
    assert found(checker) == 0
    checker.proposes(0.0, ONE, propose(LOW, TWO))
    assert found(checker) == 1
    checker.proposes(0.0, FOUR, propose(MIDDLE, THREE))
    assert found(checker) == 2
    checker.proposes(0.0, Member(2, 2), propose(MIDDLE, THREE))
    assert found(checker) == 3


# I4


def bonds(until: float = 1.0) -> OneBond:
    """Voter 3 is bound to robot 1 by a low term."""
    checker = OneBond(STD)
    checker.proposes(0.0, ONE, propose(LOW, ONE))
    checker.proposes(0.0, TWO, propose(MIDDLE, TWO))
    checker.grants(0.0, THREE, grant(LOW), until)
    return checker


@pytest.mark.parametrize(("at", "broken"), [(0.9, 1), (1.0, 0), (1.1, 0)])
def test_i4_a_bond_lasts_until_it_ends(at: float, broken: int) -> None:
    checker = bonds()
    checker.grants(at, THREE, grant(MIDDLE), 2.0)
    assert found(checker) == broken


def test_i4_the_last_bond_counts_and_the_same_holder_may_be_granted_again() -> None:
    checker = bonds()
    checker.grants(0.9, THREE, grant(LOW), 1.9)
    assert found(checker) == 0
    checker.grants(1.5, THREE, grant(MIDDLE), 2.5)
    assert found(checker) == 1


@pytest.mark.parametrize(("apart_s", "broken"), [(STD.grant_s - 0.1, 1), (STD.grant_s + 0.1, 0)])
def test_i4_a_process_that_wakes_up_late_is_bound_from_the_arrival_of_what_it_grants(
    apart_s: float, broken: int
) -> None:
    """It takes both proposals at 5 s; they had arrived `apart_s` apart, and by the second the first's bond was over."""
    checker, woke_at = OneBond(STD), 5.0
    first_at, second_at = woke_at - apart_s, woke_at
    checker.proposes(first_at, ONE, propose(LOW, ONE))
    checker.proposes(second_at, TWO, propose(MIDDLE, TWO))

    def report(fact: Any, *arguments: Any) -> None:
        getattr(checker, fact.__name__)(*arguments)

    for term, arrived_at in ((LOW, first_at), (MIDDLE, second_at)):
        report_effect(report, Send("robot1", grant(term)), THREE, woke_at, arrived_at + STD.grant_s, float)
    assert found(checker) == broken


def test_i4_a_release_frees_the_voters_of_its_term() -> None:
    for term, broken in ((LOW, 0), (MIDDLE, 1)):
        checker = bonds()
        checker.releases(0.4, term)
        checker.grants(0.5, THREE, grant(MIDDLE), 1.5)
        assert found(checker) == broken


def test_i4_a_hand_over_frees() -> None:
    gift = Term(2, 1, 1)  # issued by the one to whom the voter is bound
    checker = bonds()
    checker.proposes(0.4, ONE, propose(gift, TWO))
    checker.grants(0.5, THREE, grant(gift), 1.5)
    assert found(checker) == 0
    checker = bonds()
    checker.proposes(0.4, ONE, propose(gift, THREE))  # the voter is the receiver: its own grant is not seen
    checker.grants(0.5, THREE, grant(MIDDLE), 1.5)
    assert found(checker) == 0
    checker = bonds()
    other_life = Term(2, 1, 2)
    checker.proposes(0.4, Member(1, 2), propose(other_life, TWO))
    checker.grants(0.5, THREE, grant(other_life), 1.5)
    assert found(checker) == 1


def test_i4_a_fence_frees_also_one_of_an_earlier_life_of_the_gateway() -> None:
    for robot, restarts, broken in ((1, False, 0), (1, True, 0), (2, False, 1)):
        checker = bonds()
        checker.bars(0.3, robot, MIDDLE)
        if restarts:
            checker.gateway_starts(0.4, robot, 0.0)
        checker.grants(0.5, THREE, grant(MIDDLE), 1.5)
        assert found(checker) == broken
    checker = bonds()
    checker.gateway_starts(0.4, 1, 1.0)  # shut until the bond ends
    checker.grants(0.5, THREE, grant(MIDDLE), 1.5)
    assert found(checker) == 0


# I7


def proposed(*promised: tuple[Member, bool], conf: Config | None = None, round_number: int = 0) -> int:
    checker = NoAmnesiacVote(STD)
    for who, blank in promised:
        checker.promises(0.0, who, Promise(LOW, config(), None, blank))
    checker.proposes(0.0, ONE, propose(LOW, ONE, round_number, conf))
    return found(checker)


def test_i7_a_term_rests_on_a_quorum_that_remembers() -> None:
    assert proposed((TWO, False)) == 0  # with its own
    assert proposed() == 1
    assert proposed((TWO, True), (THREE, True)) == 1


def test_i7_or_on_promises_of_everybody() -> None:
    everybody = config(previous=Electorate(TEAM, None, "all"))
    assert proposed((TWO, True), (THREE, True), conf=everybody) == 0
    assert proposed((TWO, True), conf=everybody) == 1
    assert proposed((TWO, True), (THREE, True), conf=config(previous=OLD)) == 1


def test_i7_is_asked_of_the_first_proposal_of_a_term_alone() -> None:
    assert proposed(round_number=1) == 0
    assert proposed(conf=config(seq=1)) == 0


# I9


def test_i9_votes_join_those_who_agree() -> None:
    for other, broken in ((7, 0), (8, 1)):
        checker = OneAgreement(STD)
        checker.holds(0.0, ONE, 7)
        checker.holds(0.0, TWO, other)
        checker.promises(0.0, TWO, Promise(LOW, config(), None, blank=False))
        assert found(checker) == broken
        checker.grants(0.0, TWO, grant(LOW), 1.0)
        assert found(checker) == broken  # of whom the term is, is not known yet
        checker.proposes(0.0, ONE, propose(LOW, ONE))
        checker.grants(0.0, TWO, grant(LOW), 1.0)
        assert found(checker) == 2 * broken
        checker.promises(0.0, TWO, Promise(HIGH, config(), None, blank=False))
        assert found(checker) == 2 * broken  # what robot 3 holds is not known
