"""One held term: which grants extend the lease, from when, and how long a round can still be granted (E2)."""

from __future__ import annotations

import pytest

from lfa.protocol.lease.holder import RETRY_HEARTBEATS, ROUNDS_KEPT, Holder
from lfa.protocol.messages.consensus import Config, Grant, Member, Term, Version
from tests.rigs.lease_scenes import STD

ME, OTHER, THIRD = Member(1, 1), Member(2, 1), Member(3, 1)
TERM = Term(5, 1, 1)
CONFIG = Config(Version(TERM), (ME, OTHER, THIRD), None, None, (ME, OTHER, THIRD))


def grant(number: int, seq: int = 0) -> Grant:
    return Grant(TERM, number, Version(TERM, seq), 0.0)


def asked(rounds: int, every_s: float = 0.001) -> Holder:
    """Return a holder that has sent so many rounds, the first at 10 s, and has its own grant of the first."""
    holder = Holder(ME, TERM, STD, 10.0, agreed=1)
    for number in range(rounds):
        holder.next_propose(CONFIG, 10.0 + every_s * number)
    assert not holder.granted(ME, grant(0), CONFIG, 10.0)
    return holder


def test_the_lease_counts_from_the_newest_round_that_a_quorum_granted() -> None:
    holder = asked(2, every_s=0.04)
    assert holder.granted(OTHER, grant(0), CONFIG, 10.05)
    assert holder.expiry == pytest.approx(10.0 + STD.act_s)
    assert not holder.granted(OTHER, grant(1), CONFIG, 10.06)  # one of three, of the newer round
    assert holder.granted(THIRD, grant(1), CONFIG, 10.07)
    assert holder.expiry == pytest.approx(10.04 + STD.act_s)


def test_a_grant_that_comes_twice_or_out_of_order_extends_nothing() -> None:
    holder = asked(2, every_s=0.04)
    holder.granted(ME, grant(1), CONFIG, 10.05)
    assert holder.granted(OTHER, grant(1), CONFIG, 10.05)
    for number in (1, 0):
        assert not holder.granted(OTHER, grant(number), CONFIG, 10.06)
    assert not holder.granted(THIRD, grant(0), CONFIG, 10.07)
    assert holder.expiry == pytest.approx(10.04 + STD.act_s)


def test_a_grant_of_a_round_that_was_never_sent_extends_nothing() -> None:
    assert not asked(1).granted(OTHER, grant(1), CONFIG, 10.0)


def test_a_late_grant_counts_for_one_of_the_last_64_rounds() -> None:
    assert asked(ROUNDS_KEPT).granted(OTHER, grant(0), CONFIG, 10.1)
    forgotten = Holder(ME, TERM, STD, 10.0, agreed=1)
    for number in range(ROUNDS_KEPT + 1):
        forgotten.next_propose(CONFIG, 10.0 + 0.001 * number)
    assert not any(forgotten.granted(voter, grant(0), CONFIG, 10.1) for voter in CONFIG.voters)
    assert forgotten.granted(ME, grant(1), CONFIG, 10.1) or forgotten.granted(OTHER, grant(1), CONFIG, 10.1)


def test_a_round_waits_half_a_heartbeat_for_its_quorum_and_a_granted_one_a_whole() -> None:
    holder = asked(1)
    assert holder.next_round_at == pytest.approx(10.0 + RETRY_HEARTBEATS * STD.heartbeat_s)
    holder.granted(OTHER, grant(0), CONFIG, 10.002)
    assert holder.next_round_at == pytest.approx(10.0 + STD.heartbeat_s)


def test_a_config_is_committed_by_a_quorum_that_accepted_it_or_a_later_one() -> None:
    holder = asked(2)
    holder.granted(OTHER, grant(0), CONFIG, 10.0)
    assert holder.committed(CONFIG)
    newer = Config(Version(TERM, 1), CONFIG.voters, None, None, CONFIG.chain)
    assert not holder.committed(newer)
    holder.granted(THIRD, grant(1, seq=2), newer, 10.01)
    holder.granted(OTHER, grant(1, seq=1), newer, 10.01)
    holder.granted(OTHER, grant(0), newer, 10.02)  # late, of the older config: forgets nothing
    assert holder.committed(newer)


def test_fenced_terms_are_named_until_the_bonds_under_them_have_ended() -> None:
    fenced = (Term(4, 2, 1),)
    holder = Holder(ME, TERM, STD, 10.0, agreed=1, fenced=fenced)
    assert holder.next_propose(CONFIG, 10.0 + 0.99 * STD.grant_s).fenced == fenced
    assert holder.next_propose(CONFIG, 10.0 + STD.grant_s).fenced == ()


def test_e16_a_term_that_was_handed_over_counts_from_its_nonce_and_goes_on_after_its_issuers_round() -> None:
    holder = Holder(ME, TERM, STD, 10.0, agreed=1)
    holder.transferred(7, since=9.9)
    for voter in (ME, OTHER):
        holder.granted(voter, grant(7), CONFIG, 10.01)
    assert holder.expiry == pytest.approx(9.9 + STD.act_s)
    assert [holder.next_propose(CONFIG, 10.02 + n).round for n in range(2)] == [8, 9]


def test_an_incarnation_is_silent_after_its_last_message_and_one_never_heard_after_the_beginning() -> None:
    holder = asked(1)
    holder.granted(OTHER, grant(0), CONFIG, 10.5)
    assert [holder.silent(OTHER, at, 1.0) for at in (11.5, 11.6)] == [False, True]
    assert [holder.silent(THIRD, at, 1.0) for at in (11.0, 11.1)] == [False, True]


def test_the_last_nonce_of_each_voter_is_kept() -> None:
    holder = asked(2)
    for number, nonce in enumerate((3.5, 4.5)):
        holder.granted(OTHER, Grant(TERM, number, CONFIG.version, nonce), CONFIG, 10.1)
    assert holder.nonces[OTHER] == 4.5
