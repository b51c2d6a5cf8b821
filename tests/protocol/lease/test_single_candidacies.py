"""A candidacy of robot 1 of two that is beaten, delayed, or outlives the lease before it, by one input."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from lfa.protocol.lease.effects import Effect, Send, StepDown
from lfa.protocol.lease.election import FORGET_GRANTS
from lfa.protocol.lease.machine.lease import Lease, Observer
from lfa.protocol.lease.machine.table import LeaseState
from lfa.protocol.lease.step_down import SLOWEST
from lfa.protocol.messages.consensus import (
    Config,
    Fence,
    Fenced,
    Grant,
    Grantee,
    Hello,
    LeaseBody,
    Member,
    Nack,
    Prepare,
    Promise,
    Propose,
    Release,
    Roster,
    Term,
    Version,
)
from tests.rigs.lease_scenes import (
    ME,
    OTHER,
    OTHERS,
    STD,
    TRIO,
    TWO,
    WITNESS,
    alone,
    committed,
    led_by_other,
    proposed,
    sent,
)


def test_e4_a_candidate_whose_own_voter_hears_of_a_later_term_gives_up_and_stands_again_after_a_bonds_time() -> None:
    lease, asked_at = alone(), STD.grant_s + 0.001
    term = proposed(lease, asked_at).term
    later = replace(term, n=term.n + 5)
    assert lease.receive(OTHER, Release(later), asked_at) == []
    stands_at = STD.grant_s + STD.grant_s
    effects, at = list[Effect](), asked_at
    while not sent(effects, Release):
        at = max(at, lease.next_deadline())
        effects = lease.tick(at)
    assert [body.term for body in sent(effects, Release) if isinstance(body, Release)] == [term]
    while not sent(effects, Prepare):
        at = max(at, lease.next_deadline())
        effects = lease.tick(at)
    assert stands_at <= at < stands_at + 2.0 * STD.rank_step_s
    [prepare] = sent(effects, Prepare)
    assert isinstance(prepare, Prepare)
    assert prepare.term.n > later.n


def test_e3_a_voter_whose_holder_was_away_for_a_moment_stands_when_its_bond_ends() -> None:
    lease, began = alone(), STD.grant_s
    led_by_other(lease, Term(9, 2, 4), began)
    at = began + 0.1
    lease.hint(OTHER.id, OTHER.incarnation, False, at)
    lease.hint(OTHER.id, OTHER.incarnation, True, at)
    effects = lease.tick(at)
    while not sent(effects, Prepare):
        at = max(at, lease.next_deadline())
        effects = lease.tick(at)
    assert began + STD.grant_s <= at < began + STD.grant_s + 2.0 * STD.rank_step_s


def test_e4_the_own_gateways_word_ends_the_old_term_of_a_robot_that_is_a_candidate_by_then() -> None:
    lease, at = committed()
    term = lease.term
    lease.gateway_term(replace(term, n=term.n + 5), at)
    lease.commanded(at + STD.act_s)
    effects = lease.tick(at + STD.act_s)
    assert not sent(effects, Release), "its robot may still move"
    assert [effect.cause for effect in effects if isinstance(effect, StepDown)] == ["expired"]
    [fence] = sent(effects, Fence)
    assert isinstance(fence, Fence)
    answer = Fenced(fence.old, fence.term)
    [release] = sent(lease.receive(ME, answer, at + STD.act_s + 0.001), Release)
    assert isinstance(release, Release)
    assert release.term == term


def fencing(observer: Observer) -> tuple[Lease, Prepare, float]:
    """A candidate that a quorum has promised, one of which is bound to the other robot's term 9."""
    lease = alone(observer)
    config = led_by_other(lease, Term(9, 2, 4), STD.grant_s)
    effects, at = list[Effect](), 2.0 * STD.grant_s
    while not sent(effects, Prepare):
        at = max(at, lease.next_deadline())
        effects = lease.tick(at)
    [asks] = sent(effects, Prepare)
    assert isinstance(asks, Prepare)
    effects = lease.receive(WITNESS, Promise(asks.term, config, Grantee(Term(9, 2, 4), OTHER), False), at)
    assert len(sent(effects, Fence)) == 1
    return lease, asks, at


def test_e15_only_the_answer_to_its_own_fence_lets_a_candidate_go_on() -> None:
    states: list[LeaseState] = []
    lease, asks, at = fencing(lambda observed: states.append(observed.after))
    assert states[-2:] == [LeaseState.CANDIDATE, LeaseState.FENCING]
    assert not sent(lease.receive(OTHER, Fenced(Term(9, 2, 4), replace(asks.term, n=asks.term.n - 1)), at), Propose)
    assert sent(lease.receive(OTHER, Fenced(Term(9, 2, 4), asks.term), at), Propose)


def test_e6_a_newer_config_that_has_no_quorum_yet_ends_the_wait_for_fences() -> None:
    states: list[LeaseState] = []
    lease, asks, at = fencing(lambda observed: states.append(observed.after))
    others = tuple(Member(n, 1) for n in (3, 4, 5, 6))
    newer = Config(Version(Term(9, 2, 4), 1), (*TRIO, *others), WITNESS, None, (OTHER, ME))
    lease.receive(OTHER, Nack(asks.term, asks.term, None, 0.0, newer), at)
    assert states[-1] is LeaseState.CANDIDATE


def test_e21_gateways_of_the_absent_are_waited_for_only_without_a_quorum() -> None:
    lease = Lease(ME, replace(TWO, lonely="continue_after", continue_after_s=2.0), STD, 0.0, 0)
    config = led_by_other(lease, Term(9, 2, 4), STD.grant_s)
    effects, at, asks = list[Effect](), STD.grant_s, list[LeaseBody]()
    while not sent(effects, Fence):
        at = max(at, lease.next_deadline())
        effects = lease.tick(at)
        asks += sent(effects, Prepare)
    asked = asks[-1]
    assert isinstance(asked, Prepare)
    assert sent(lease.receive(WITNESS, Promise(asked.term, config, None, False), at), Propose)


def test_a_term_is_never_used_twice_also_by_a_candidate_whose_own_voter_is_still_silent() -> None:
    lease, terms = alone(), list[Term]()
    for at in (0.10, 0.15):
        lease.request_forget((OTHER,), at)
        [asks] = sent(lease.tick(at), Prepare)
        assert isinstance(asks, Prepare)
        terms.append(asks.term)
    assert terms[0] < terms[1]


def test_e21_a_robot_that_has_led_is_not_lonely_before_its_wait_counted_from_then() -> None:
    lease = Lease(ME, replace(TWO, lonely="continue_after", continue_after_s=2.0), STD, 0.0, 0)
    at = led_from = STD.grant_s + 0.001
    for other in OTHERS:
        lease.receive(other, Hello(None, lease.agreed), 0.0)
    propose = proposed(lease, at)
    for other in OTHERS:
        lease.receive(other, Grant(propose.term, propose.round, propose.config.version, at), at)
    assert lease.may_command(at)
    fenced: list[str] = []
    while "gateway2" not in fenced:
        at = max(at, lease.next_deadline())
        fenced = [effect.to for effect in lease.tick(at) if isinstance(effect, Send) and isinstance(effect.body, Fence)]
    assert 2.0 <= at - led_from < 2.0 + STD.grant_s + STD.act_s


# --- refused -----------------------------------------------------------------------------------------------------


def until_prepare(lease: Lease, at: float) -> tuple[Prepare, float]:
    """Tick from `at` [s] on; return the next PREPARE and its time."""
    effects = lease.tick(at)
    while not sent(effects, Prepare):
        at = max(at, lease.next_deadline())
        effects = lease.tick(at)
    [asks] = sent(effects, Prepare)
    assert isinstance(asks, Prepare)
    return asks, at


def test_e34_a_candidate_that_a_refusal_tells_of_its_retirement_never_stands_again() -> None:
    lease = alone()
    asks, at = until_prepare(lease, STD.grant_s)
    version = Version(Term(9, 2, 4))
    retired = Config(version, (OTHER, WITNESS), WITNESS, None, (OTHER,), Roster(retired=(ME.id,)))
    lease.receive(OTHER, Nack(asks.term, asks.term, None, 0.0, retired), at)
    while at < 10.0 * STD.grant_s:
        at = max(at, lease.next_deadline())
        assert not sent(lease.tick(at), Prepare)


def test_e20_a_refusal_with_a_newer_config_repeats_a_request_that_forgets_only_while_the_word_holds() -> None:
    for late_s, repeats in ((-0.001, True), (0.001, False)):
        lease, at = alone(), STD.grant_s
        lease.request_forget((OTHER,), at)
        asks, at = until_prepare(lease, at)
        assert asks.forget == (OTHER,)
        newer = Config(Version(Term(9, 2, 4)), TRIO, WITNESS, None, (OTHER, ME))
        now = STD.grant_s + FORGET_GRANTS * STD.grant_s + late_s
        again = sent(lease.receive(WITNESS, Nack(asks.term, asks.term, None, 0.0, newer), now), Prepare)
        if repeats:
            assert again == [replace(asks, version=newer.version)]
        else:
            assert not again
            asked_anew, then = until_prepare(lease, now)
            assert then < now + 3.0 * STD.rank_step_s
            assert asked_anew.forget == ()
            assert asked_anew.term > asks.term


def test_e20_whoever_knows_a_leader_or_is_named_itself_or_is_told_of_nobody_forgets_nobody() -> None:
    now = STD.grant_s - 0.05
    for lost, forgets in (((ME,), False), ((), False), ((Member(9, 1),), False), ((OTHER,), True)):
        lease = alone()
        lease.request_forget(lost, now)
        assert bool(sent(lease.tick(now), Prepare)) == forgets
    lease = alone()
    led_by_other(lease, Term(9, 2, 4), now)
    lease.request_forget((WITNESS,), now)
    assert not sent(lease.tick(now + STD.rank_step_s), Prepare)


def test_e3_a_candidate_asks_again_when_the_bond_has_ended_by_the_slowest_clock() -> None:
    lease = alone()
    asks, at = until_prepare(lease, STD.grant_s)
    lease.receive(WITNESS, Nack(asks.term, Term(), OTHER, 0.2, lease.config), at)
    again, then = until_prepare(lease, at)
    assert again.term == asks.term
    assert then == pytest.approx(at + 0.2 * SLOWEST, abs=1e-9)


def test_e9_a_leader_that_a_refusal_tells_of_a_later_leader_stops_whatever_was_promised() -> None:
    for ahead in (0, 5):
        lease, at = committed()
        later = Version(replace(lease.config.version.term, n=lease.term.n + 3))
        config = Config(later, TRIO, WITNESS, None, (OTHER, ME))
        promised = replace(lease.term, n=lease.term.n + ahead)
        effects = lease.receive(OTHER, Nack(lease.term, promised, None, 0.0, config), at)
        assert [effect.cause for effect in effects if isinstance(effect, StepDown)] == ["deposed"]
        assert not sent(effects, Prepare)


def test_e9_a_follower_that_hears_of_a_newer_config_gives_its_holder_time() -> None:
    """Until the bond that the refusal names is over by the slowest clock, or a heartbeat."""
    for remaining_s, waits_s in ((0.2, 0.2 * SLOWEST), (0.0, STD.heartbeat_s)):
        lease, at = alone(), STD.grant_s - 0.001
        config = Config(Version(Term(9, 2, 4)), TRIO, WITNESS, None, (ME, OTHER))
        lease.receive(WITNESS, Nack(Term(), Term(9, 2, 4), None, remaining_s, config), at)
        _, then = until_prepare(lease, at)
        assert then == pytest.approx(at + waits_s + STD.rank_step_s, abs=1e-9)
