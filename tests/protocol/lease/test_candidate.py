"""One candidacy: when it asks again, which leases it must see fenced, when it is beaten, and who makes a start."""

from __future__ import annotations

import pytest

from lfa.protocol.lease.candidate import Candidate
from lfa.protocol.lease.holder import Holder
from lfa.protocol.messages.consensus import NO_TERM, Config, Grant, Grantee, Member, Term, Version
from tests.rigs.lease_scenes import STD

ME, SECOND, THIRD, WITNESS = Member(1, 1), Member(2, 1), Member(3, 1), Member(0, 1)
TERM, OLD, OLDER = Term(5, 1, 1), Term(4, 2, 1), Term(3, 2, 1)
CONFIG = Config(Version(OLD), (ME, SECOND, THIRD), None, None, (ME, SECOND, THIRD))
MEMBER_IDS = (1, 2, 3, 0)


def standing(*forget: Member) -> Candidate:
    return Candidate(TERM, STD, 10.0, forget)


def proposing(*granted: Member) -> Candidate:
    """Return a candidate in phase 2, with the grants of these voters."""
    candidate = standing()
    candidate.holder = Holder(ME, TERM, STD, 10.0, agreed=1)
    for voter in granted:
        candidate.holder.granted(voter, Grant(TERM, 0, CONFIG.version, 0.0), CONFIG, 10.0)
    return candidate


def nobody(_member: Member) -> bool:
    return False


def test_pauses_between_two_askings_grow_to_a_heartbeat() -> None:
    candidate, pauses = standing(), []
    assert candidate.ask_at == 10.0 and not candidate.fencing
    for _ in range(6):
        candidate.asked(11.0)
        pauses.append(candidate.ask_at - 11.0)
    assert pauses[0] == pytest.approx(2.0 * STD.rank_step_s)
    assert pauses == sorted(pauses)
    assert pauses[-1] == pytest.approx(STD.heartbeat_s)


def test_e3_the_next_asking_waits_for_the_last_bond_that_was_named_since_the_last() -> None:
    candidate = standing()
    candidate.asked(10.0)
    for at in (10.2, 10.3, 10.1):
        candidate.wait_until(at)
    assert candidate.ask_at == 10.3
    candidate.asked(10.15)
    candidate.wait_until(10.25)
    assert candidate.ask_at == 10.25


def test_e2_a_candidacy_is_given_up_when_its_first_grants_have_expired() -> None:
    assert standing().gives_up_at == float("inf")
    assert proposing().gives_up_at == pytest.approx(10.0 + STD.act_s)


def test_e15_the_newest_answer_of_a_voter_names_its_lease() -> None:
    candidate = standing()
    candidate.promised(SECOND, Grantee(OLD, THIRD), blank=False)
    assert candidate.unfenced(ME) == [Grantee(OLD, THIRD)]
    candidate.promised(SECOND, None, blank=False)
    assert candidate.unfenced(ME) == []


def test_e15_a_fence_counts_for_one_gateway_and_one_term() -> None:
    candidate = standing()
    leases = [Grantee(OLDER, SECOND), Grantee(OLD, SECOND), Grantee(OLD, THIRD)]
    for voter, lease in zip((ME, SECOND, THIRD), leases, strict=True):
        candidate.promised(voter, lease, blank=False)
    candidate.fenced(SECOND.id, OLD)
    assert candidate.unfenced(ME) == [Grantee(OLDER, SECOND), Grantee(OLD, THIRD)]
    assert candidate.fenced_terms == (OLD,)


def test_e15_the_own_lease_needs_no_fence_and_a_fence_is_asked_for_once_an_asking() -> None:
    candidate = standing()
    candidate.promised(SECOND, Grantee(OLD, ME), blank=False)
    assert candidate.fences_to_ask(ME) == []
    candidate.promised(THIRD, Grantee(OLD, SECOND), blank=False)
    assert candidate.fences_to_ask(ME) == [Grantee(OLD, SECOND)]
    assert candidate.fences_to_ask(ME) == []
    candidate.asked(10.1)
    assert candidate.fences_to_ask(ME) == [Grantee(OLD, SECOND)]


def test_e6_in_phase_1_one_refusal_beats_a_candidate() -> None:
    assert standing().refused(SECOND, CONFIG, nobody)


def test_e6_in_phase_2_it_is_beaten_when_no_quorum_is_left() -> None:
    candidate = proposing(ME)
    assert not candidate.refused(SECOND, CONFIG, nobody)
    assert candidate.refused(THIRD, CONFIG, nobody)


def test_e6_an_incarnation_that_ended_counts_only_with_its_grant() -> None:
    def ended(member: Member) -> bool:
        return member == THIRD

    assert proposing(ME).refused(SECOND, CONFIG, ended)
    assert not proposing(ME, THIRD).refused(SECOND, CONFIG, ended)


def test_e18_only_who_knows_a_config_makes_a_quorum_of_it() -> None:
    candidate = standing()
    candidate.promised(ME, None, blank=False)
    candidate.promised(SECOND, None, blank=True)
    assert not candidate.has_quorum(CONFIG)
    candidate.promised(THIRD, None, blank=False)
    assert candidate.has_quorum(CONFIG)


def test_e18_a_unanimous_start_needs_every_id_and_no_quorum_of_a_config() -> None:
    candidate = standing()
    for voter in (ME, SECOND, WITNESS):
        candidate.promised(voter, None, blank=True)
    assert candidate.full_house(CONFIG, MEMBER_IDS, nobody) == ()
    candidate.promised(THIRD, None, blank=True)
    assert candidate.full_house(CONFIG, MEMBER_IDS, nobody) == (ME, SECOND, THIRD, WITNESS)
    again = Member(3, 2)
    candidate.promised(again, None, blank=True)
    assert candidate.full_house(CONFIG, MEMBER_IDS, nobody) == (ME, SECOND, again, WITNESS)
    assert candidate.full_house(CONFIG, MEMBER_IDS, lambda member: member == again) == (ME, SECOND, THIRD, WITNESS)
    for voter in (ME, SECOND):
        candidate.promised(voter, None, blank=False)
    assert candidate.full_house(CONFIG, MEMBER_IDS, nobody) == ()


def test_e20_a_forgotten_id_is_not_waited_for() -> None:
    candidate = standing(THIRD)
    for voter in (ME, SECOND, WITNESS):
        candidate.promised(voter, None, blank=True)
    assert candidate.full_house(CONFIG, MEMBER_IDS, nobody) == (ME, SECOND, WITNESS)


def test_e19_a_majority_starts_with_the_witness_more_than_half_and_without_memory() -> None:
    def here(*voters: Member, blank: bool = True) -> tuple[Member, ...]:
        candidate = standing()
        for voter in voters:
            candidate.promised(voter, None, blank=blank)
        return candidate.blank_majority(MEMBER_IDS, nobody)

    assert here(ME, SECOND, WITNESS) == (ME, SECOND, WITNESS)
    assert here(ME, WITNESS) == ()
    assert here(ME, SECOND, THIRD) == ()
    assert here(ME, SECOND, WITNESS, blank=False) == ()


def test_e21_the_gateways_of_absent_robots_are_to_be_fenced_too_and_the_witness_has_none() -> None:
    candidate = standing()
    candidate.promised(ME, None, blank=False)
    assert candidate.any_answering(MEMBER_IDS, nobody) == (ME,)
    named = candidate.unfenced(ME)
    assert [(lease.term, lease.holder.id) for lease in named] == [(NO_TERM, 2), (NO_TERM, 3)]
    candidate.fenced(2, NO_TERM)
    assert [lease.holder.id for lease in candidate.unfenced(ME)] == [3]
    assert candidate.fenced_terms == ()
    candidate.expects_nobody()
    assert candidate.unfenced(ME) == []
