"""One message of a candidate or a holder at a lease of robot 1 of two, and what follows from that alone."""

from __future__ import annotations

from msgspec.structs import replace

from lfa.protocol.lease.effects import BecomeLeader, Effect, Send, StepDown
from lfa.protocol.lease.machine.lease import Lease
from lfa.protocol.lease.machine.table import LeaseState
from lfa.protocol.lease.membership import VOTERS_MAX
from lfa.protocol.lease.term_window import BURST, FREE, FRESH, RATE_HZ
from lfa.protocol.messages.consensus import (
    Config,
    Fence,
    Grant,
    Hello,
    Member,
    Nack,
    Prepare,
    Promise,
    Propose,
    Release,
    Term,
    Version,
)
from tests.rigs.lease_scenes import (
    HIGH,
    LOW,
    ME,
    OTHER,
    OTHERS,
    STD,
    TWO,
    WITNESS,
    A,
    B,
    alone,
    ask,
    committed,
    config_of,
    led_by_other,
    proposed,
    sent,
    voter,
)

# --- answers to candidates and holders -----------------------------------------------------------------------------


def test_e20_a_candidate_that_forgets_this_process_is_refused_and_told_so() -> None:
    lease = alone()
    at = STD.grant_s + 0.1
    lease.receive(OTHER, Prepare(Term(9, 2, 4), Version(Term(3, 2, 4)), (), lease.agreed), at)
    [refusal] = sent(lease.receive(OTHER, Prepare(HIGH, Version(LOW), (ME,), lease.agreed), at), Nack)
    assert isinstance(refusal, Nack)
    assert refusal.term == HIGH


def test_e3_what_was_granted_is_promised() -> None:
    """Without a PREPARE before it, too: when the bond is over, no lower term is promised."""
    free = voter()
    assert isinstance(ask(free, B, HIGH, 10.0), Grant)
    refusal = free.prepare(A, Prepare(LOW, Version(HIGH)), config_of(HIGH), 10.0 + STD.grant_s)
    assert isinstance(refusal, Nack)
    assert refusal.promised == HIGH


def test_promises_and_grants_of_another_term_count_for_nothing() -> None:
    lease, asked_at = alone(), STD.grant_s + 0.001
    [prepare] = sent(lease.tick(STD.grant_s), Prepare)
    assert isinstance(prepare, Prepare)
    other = replace(prepare.term, n=prepare.term.n - 1)
    for source in OTHERS:
        assert lease.receive(source, Promise(other, lease.config, None, True), asked_at) == []
    lease = alone()
    propose = proposed(lease, asked_at)
    for term in (replace(propose.term, n=propose.term.n - 1), replace(propose.term, n=propose.term.n + 1)):
        for source in OTHERS:
            assert lease.receive(source, Grant(term, propose.round, propose.config.version, 0.0), asked_at) == []
    assert not lease.may_command(asked_at)


def test_a_leader_begins_with_the_config_that_its_voters_have_granted() -> None:
    lease, asked_at = alone(), STD.grant_s + 0.001
    propose = proposed(lease, asked_at)
    grant = Grant(propose.term, propose.round, propose.config.version, 0.0)
    effects = [effect for source in OTHERS for effect in lease.receive(source, grant, asked_at)]
    assert any(isinstance(effect, BecomeLeader) for effect in effects)
    assert lease.config == propose.config


def test_e16_a_term_that_names_this_process_without_its_own_nonce_is_not_taken_over() -> None:
    """From no time of its own clock could the lease count: it does not even begin a candidacy."""
    for nonce, leads in ((None, False), (STD.grant_s + 0.29, True)):
        states: set[LeaseState] = set()
        lease = alone(lambda observed, states=states: states.add(observed.after))
        config = led_by_other(lease, Term(9, 2, 4), STD.grant_s + 0.2)
        given = Propose(Term(10, 2, 4), config, 1, ME, (), nonce, lease.agreed)
        at = STD.grant_s + 0.3
        effects = lease.receive(OTHER, given, at)
        assert states - {LeaseState.FOLLOWER} == ({LeaseState.TAKING_OVER} if leads else set())
        for source in OTHERS:
            effects += lease.receive(source, Grant(given.term, 1, config.version, at), at)
        assert any(isinstance(effect, BecomeLeader) for effect in effects) == leads


def test_e16_grants_that_come_before_their_hand_over_count_when_it_comes() -> None:
    """Those of terms that are over by then do not."""
    lease, at = alone(), STD.grant_s + 0.3
    config = led_by_other(lease, Term(9, 2, 4), STD.grant_s + 0.2)
    for n in (9, 10):
        for source in OTHERS:
            assert lease.receive(source, Grant(Term(n, 2, 4), 1, config.version, at), at) == []
    effects = lease.receive(OTHER, Propose(Term(10, 2, 4), config, 1, ME, (), at - 0.01, lease.agreed), at)
    assert any(isinstance(effect, BecomeLeader) for effect in effects)
    assert lease.may_command(at)


def test_e26_what_is_believed_of_others_counts_from_the_own_gateways_term_and_from_the_own_one() -> None:
    """Both may be higher than a process believes of others that knows no term."""
    seen = FREE + FRESH + 100
    for ahead, believed in ((0, True), (1, False)):
        lease, now = alone(), STD.grant_s
        lease.gateway_term(Term(seen, 2, 4), 0.1)
        [own] = sent(lease.tick(now), Prepare)
        assert isinstance(own, Prepare)
        assert own.term.n == seen + 1
        beyond = Term(own.term.n + BURST + int(RATE_HZ * now) + ahead, OTHER.id, OTHER.incarnation)
        later = Version(Term(own.term.n, OTHER.id, OTHER.incarnation))
        answers = sent(lease.receive(OTHER, Prepare(beyond, later, (), lease.agreed), now), Promise)
        assert len(answers) == believed


def test_e26_a_term_of_the_own_gateway_is_known_to_whoever_only_votes_too() -> None:
    lease, seen = alone(), FREE + FRESH + 100
    request = Prepare(Term(seen + 1, OTHER.id, OTHER.incarnation), Version(LOW), (), lease.agreed)
    assert lease.receive(OTHER, request, STD.grant_s) == [], "too far ahead"
    lease.gateway_term(Term(seen, 2, 4), STD.grant_s)
    assert sent(lease.receive(OTHER, request, STD.grant_s), Promise)


def test_e20_an_operators_word_is_acted_upon_at_once() -> None:
    lease, now = alone(), STD.grant_s + 0.1
    lease.tick(STD.grant_s)
    lease.request_forget((OTHER,), now)
    [prepare] = sent(lease.tick(now), Prepare)
    assert isinstance(prepare, Prepare)
    assert prepare.forget == (OTHER,)


def test_e6_whoever_promised_a_term_stands_when_its_candidate_has_not_led_for_two_heartbeats() -> None:
    lease = alone()
    config = led_by_other(lease, Term(9, 2, 4), STD.grant_s)
    now = 3.0 * STD.grant_s
    request = Prepare(Term(10, 2, 4), config.version, (), lease.agreed)
    assert len(sent(lease.receive(OTHER, request, now), Promise)) == 1
    waits_s = 2.0 * STD.heartbeat_s
    assert not sent(lease.tick(now + 0.99 * waits_s), Prepare)
    assert sent(lease.tick(now + waits_s + 2.0 * STD.rank_step_s), Prepare)


def test_e9_whoever_asks_under_an_older_config_that_does_not_name_this_process_hears_of_the_newer_one() -> None:
    lease, stranger = alone(), Member(3, 5)
    config = led_by_other(lease, Term(9, 2, 4), STD.grant_s)
    older = Config(Version(Term(8, 3, 5)), (stranger, WITNESS), WITNESS, None, (stranger,))
    propose = Propose(Term(10, 3, 5), older, 0, stranger, agreed=lease.agreed)
    [refusal] = sent(lease.receive(stranger, propose, STD.grant_s + 0.1), Nack)
    assert isinstance(refusal, Nack)
    assert refusal.config == config
    assert lease.leader == OTHER.id


def test_e3_a_leader_whose_own_voter_grants_another_holder_leads_no_more() -> None:
    """Its term has been fenced; the config is the one that it wrote itself."""
    lease, at = committed()
    later = Term(lease.term.n + 5, OTHER.id, OTHER.incarnation)
    propose = Propose(later, lease.config, 0, OTHER, (lease.term,), agreed=lease.agreed)
    effects = lease.receive(OTHER, propose, at)
    assert [effect.cause for effect in effects if isinstance(effect, StepDown)] == ["deposed"]
    assert len(sent(effects, Grant)) == 1
    assert not lease.may_command(at)


def test_a_leader_that_is_named_as_holder_of_another_term_goes_on_leading() -> None:
    lease, at = committed()
    later = Term(lease.term.n + 5, OTHER.id, OTHER.incarnation)
    effects = lease.receive(OTHER, Propose(later, lease.config, 0, ME, (), at, lease.agreed), at)
    assert not [effect for effect in effects if isinstance(effect, StepDown)]
    assert lease.may_command(at)


def test_e18_whoever_promised_a_term_of_the_first_election_waits_twenty_heartbeats_for_its_lease() -> None:
    lease, now = Lease(OTHER, TWO, STD, 0.0, 0), STD.grant_s
    asks = Prepare(Term(9, ME.id, ME.incarnation), lease.config.version, (), lease.agreed)
    assert len(sent(lease.receive(ME, asks, now), Promise)) == 1
    waits_s = 20.0 * STD.heartbeat_s
    assert not sent(lease.tick(now + 0.99 * waits_s), Prepare)
    assert sent(lease.tick(now + waits_s + 2.0 * STD.rank_step_s), Prepare)


def test_e21_a_robot_that_hears_of_another_holder_is_not_lonely_for_as_long_again() -> None:
    """Of one that is free, or bound to this robot itself, it hears nothing that would keep it waiting."""
    fenced_at = {}
    for holder, remaining_s in ((None, 0.0), (ME, 0.1), (OTHER, 0.1)):
        lease = Lease(ME, replace(TWO, lonely="continue_after", continue_after_s=2.0), STD, 0.0, 0)
        began = at = STD.grant_s
        config = led_by_other(lease, Term(9, 2, 4), began)
        heard_at, effects = began + 1.5, list[Effect]()
        while not sent(effects, Fence):
            at = max(at, lease.next_deadline())
            if heard_at is not None and at > heard_at:
                asked = max(lease.config.version.term, Term(10, ME.id, ME.incarnation))
                lease.receive(WITNESS, Nack(asked, asked, holder, remaining_s, config), heard_at)
                at, heard_at = heard_at, None
            effects = lease.tick(at)
        fenced_at[holder] = at - began
    assert 2.0 <= fenced_at[None] < 2.0 + STD.grant_s
    assert 2.0 <= fenced_at[ME] < 2.0 + STD.grant_s
    assert 3.5 <= fenced_at[OTHER] < 3.5 + STD.grant_s


def test_e4_a_prepare_that_overtook_the_release_is_answered_again_when_it_comes() -> None:
    """A token that vanishes besides is no end of the bond: nothing is answered again."""
    lease, now = alone(), STD.grant_s
    config = led_by_other(lease, Term(9, 2, 4), now)
    asks = Prepare(Term(12, WITNESS.id, WITNESS.incarnation), config.version, (), lease.agreed)
    assert len(sent(lease.receive(WITNESS, asks, now + 0.01), Nack)) == 1
    assert not lease.hint(WITNESS.id, WITNESS.incarnation, False, now + 0.02)
    [promise] = sent(lease.receive(OTHER, Release(Term(9, 2, 4)), now + 0.03), Promise)
    assert isinstance(promise, Promise)
    assert promise.term == asks.term


def test_e16_of_the_grants_that_come_before_a_hand_over_as_many_are_kept_as_there_may_be_voters() -> None:
    for later, leads in ((VOTERS_MAX - 1, True), (VOTERS_MAX, False)):
        lease, at = alone(), STD.grant_s + 0.3
        config = led_by_other(lease, Term(9, 2, 4), STD.grant_s + 0.2)
        lease.receive(WITNESS, Grant(Term(10, 2, 4), 1, config.version, at), at)
        for _ in range(later):
            lease.receive(OTHER, Grant(Term(11, 2, 4), 1, config.version, at), at)
        effects = lease.receive(OTHER, Propose(Term(10, 2, 4), config, 1, ME, (), at - 0.01, lease.agreed), at)
        assert any(isinstance(effect, BecomeLeader) for effect in effects) == leads


def test_e9_whoever_follows_a_leader_without_a_vote_greets_it_alone_and_without_a_leader_all() -> None:
    lease = alone()
    assert [lease.hello_of(other.id) for other in OTHERS] == [(other, 0.0) for other in OTHERS]
    term, began = Term(9, 2, 4), STD.grant_s
    config = Config(Version(term), (OTHER, WITNESS), WITNESS, None, (OTHER, ME))
    lease.receive(OTHER, Propose(term, config, 0, OTHER, agreed=lease.agreed), began)
    for until, receiver in ((began + STD.grant_s, "robot2"), (began + 3.0 * STD.grant_s, "all")):
        greeted, at = set[str](), began
        while (at := max(at, lease.next_deadline())) < until:
            greeted |= {e.to for e in lease.tick(at) if isinstance(e, Send) and isinstance(e.body, Hello)}
        assert greeted == {receiver}
        began = at
