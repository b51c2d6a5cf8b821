"""A lease of robot 1 of two that leaves, or has led: what one input ends, and what it does not."""

from __future__ import annotations

from msgspec.structs import replace

from lfa.protocol.lease.effects import LeaseExtended
from lfa.protocol.messages.consensus import Fence, Fenced, Grant, Prepare, Promise, Propose, Release
from tests.rigs.lease_scenes import ME, OTHER, OTHERS, STD, alone, committed, elected, proposed, sent


def test_e2_a_round_that_a_quorum_grants_extends_the_lease_from_when_it_was_asked_for() -> None:
    lease, at = committed()
    at = max(at, lease.next_deadline())
    propose = sent(lease.tick(at), Propose)[-1]
    assert isinstance(propose, Propose)
    grant = Grant(propose.term, propose.round, propose.config.version, at)
    effects = [effect for other in OTHERS for effect in lease.receive(other, grant, at + 0.01)]
    assert [effect.expiry for effect in effects if isinstance(effect, LeaseExtended)] == [at + STD.act_s]


def test_e4_only_the_own_gateways_word_of_the_own_last_term_ends_a_step_down() -> None:
    lease, _, at, _ = elected(slow_s=0.001)
    lease.commanded(at)
    [fence] = sent(lease.request_release(at), Fence)
    assert isinstance(fence, Fence)
    assert not lease.released
    assert not sent(lease.receive(OTHER, Fenced(fence.old, fence.term), at), Release)
    earlier = replace(fence.old, n=fence.old.n - 1)
    assert not sent(lease.receive(ME, Fenced(earlier, fence.term), at), Release)
    assert not lease.released
    assert sent(lease.receive(ME, Fenced(fence.old, fence.term), at), Release)
    assert lease.released


def test_e4_who_leaves_without_a_lease_may_end_at_once_and_never_stands() -> None:
    lease, at = alone(), 0.1
    lease.request_release(at)
    assert lease.released
    while at < 10.0 * STD.grant_s:
        at = max(at + STD.rank_step_s, min(lease.next_deadline(), 10.0 * STD.grant_s))
        assert not sent(lease.tick(at), Prepare)


def test_e4_a_candidate_that_leaves_frees_its_voters_and_its_own_one() -> None:
    lease, at = alone(), STD.grant_s + 0.001
    propose = proposed(lease, at)
    [release] = sent(lease.request_release(at), Release)
    assert isinstance(release, Release)
    assert release.term == propose.term
    asks = Prepare(replace(propose.term, n=propose.term.n + 1, issuer=2), lease.config.version, (), lease.agreed)
    assert sent(lease.receive(OTHER, asks, at), Promise)
