"""What an agent reads of a lease of robot 1 of two; one token or one word of its gateway, and what follows from it."""

from __future__ import annotations

from collections.abc import Callable

from msgspec.structs import replace

from lfa.protocol.geometry import Twist
from lfa.protocol.lease.agreement import agreement_of
from lfa.protocol.lease.effects import Effect, StandAside, StepDown
from lfa.protocol.lease.gateway import Gateway
from lfa.protocol.lease.machine.lease import Lease
from lfa.protocol.messages.consensus import (
    NO_TERM,
    Config,
    Fence,
    GatewayStamp,
    Hello,
    Nack,
    Prepare,
    Propose,
    Roster,
    Term,
    Version,
)
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import CmdVel
from lfa.protocol.messages.stop import NEVER_STOPPED
from tests.rigs.lease_scenes import (
    HIGH,
    LOW,
    ME,
    OTHER,
    STD,
    TRIO,
    TWO,
    WITNESS,
    alone,
    committed,
    elected,
    sent,
)

# --- what an agent reads -----------------------------------------------------------------------------------------


def test_a_leader_is_committed_and_settled_while_no_change_is_under_way() -> None:
    lease, at = committed()
    assert lease.is_committed
    assert lease.is_settled(at + 0.9 * STD.act_s)
    assert not lease.is_settled(at + 1.1 * STD.act_s), "the lease is over by then"
    lease.gateway_term(replace(lease.term, n=lease.term.n + 5), at)
    assert not lease.is_settled(at + 0.1 * STD.act_s), "E10: it raises its term"


def test_who_does_not_lead_is_neither_committed_nor_settled_and_has_no_successor() -> None:
    lease = alone()
    assert not lease.is_committed
    assert not lease.is_settled(-1.0)
    assert lease.successor(0.0) is None


def test_e16_the_successor_of_a_leader_is_the_next_that_it_has_heard() -> None:
    lease, at = committed()
    assert lease.successor(at) == OTHER.id
    assert lease.successor(at + STD.chain_silence_s + 0.01) is None


# --- tokens, and words of the own gateway --------------------------------------------------------------------------


def test_e7_a_token_that_changes_after_the_leases_end_ends_it_first() -> None:
    for up in (True, False):
        lease, asked_at, _, _ = elected(slow_s=0.001)
        effects = lease.hint(OTHER.id, OTHER.incarnation, up, asked_at + STD.act_s)
        assert isinstance(effects[0], StepDown)


def test_e7_a_word_that_comes_after_the_leases_end_ends_it_first() -> None:
    words: dict[str, Callable[[Lease, float], list[Effect]]] = {
        "gateway": lambda lease, at: lease.gateway_term(NO_TERM, at),
        "hand-over": lambda lease, at: lease.request_handover(at),
        "roster": lambda lease, at: lease.request_roster(Roster(), at),
        "forget": lambda lease, at: lease.request_forget((), at),
    }
    for name, word in words.items():
        lease, asked_at, _, _ = elected(slow_s=0.001)
        effects = word(lease, asked_at + STD.act_s)
        assert isinstance(effects[0], StepDown), name
        assert effects[0].cause == "expired", name


def test_e25_whoever_says_the_same_by_now_counts_as_odd_no_more() -> None:
    for says_the_same, stands_aside in ((False, True), (True, False)):
        lease = alone()
        other = agreement_of(replace(TWO, witness=False), STD)
        effects = lease.receive(WITNESS, Nack(NO_TERM, NO_TERM, None, 0.0, lease.config, other), 0.1)
        assert effects == []
        if says_the_same:
            lease.receive(WITNESS, Hello(None, lease.agreed), 0.1)
        effects = lease.receive(OTHER, Nack(NO_TERM, NO_TERM, None, 0.0, lease.config, other), 0.2)
        assert any(isinstance(effect, StandAside) for effect in effects) == stands_aside


def test_a_token_that_returns_makes_its_process_one_that_is_there() -> None:
    lease = alone()
    lease.hint(OTHER.id, OTHER.incarnation, False, 0.1)
    assert lease.peers.is_gone(OTHER)
    lease.hint(OTHER.id, OTHER.incarnation, True, 0.2)
    assert not lease.peers.is_gone(OTHER)


def test_e24_an_own_term_is_above_the_highest_that_the_own_gateway_has_seen() -> None:
    lease = alone()
    for n in (50, 40):
        lease.gateway_term(Term(n, 2, 4), 0.1)
    [prepare] = sent(lease.tick(STD.grant_s), Prepare)
    assert isinstance(prepare, Prepare)
    assert prepare.term == Term(51, ME.id, ME.incarnation)


def test_e24_a_refused_holder_is_told_the_term_of_the_gateway_also_when_it_asks_again() -> None:
    """Whoever promises less than its gateway has seen would be the holder's voter and not move for it."""
    lease = alone()
    lease.gateway_term(Term(50, 2, 4), 0.1)
    low = Term(9, OTHER.id, OTHER.incarnation)
    propose = Propose(low, Config(Version(low), TRIO, WITNESS, None, (OTHER, ME)), 0, OTHER, agreed=lease.agreed)
    for at in (STD.grant_s + 0.1, STD.grant_s + 0.2):
        [refusal] = sent(lease.receive(OTHER, propose, at), Nack)
        assert isinstance(refusal, Nack)
        assert refusal.promised == Term(50, 2, 4)


def test_e23_a_number_that_only_its_gateway_knows_is_a_later_life_of_this_process() -> None:
    lease = alone()
    for known, newest in ((None, None), (ME.incarnation, None), (ME.incarnation - 1, None), (9, 9), (8, 9), (10, 10)):
        lease.learn_incarnation(known)
        assert lease.superseded_by == newest


# --- the gateway's holder of a term --------------------------------------------------------------------------------


def test_e12_after_a_fence_the_first_command_of_the_term_says_who_holds_it() -> None:
    gateway, now = Gateway(1, 9, STD, -10.0), 1.0
    gateway.agent_up(5, now)

    def command(holder: int, term: Term) -> str | None:
        header, stamp = Header("robot1", 5, 1, now), GatewayStamp(9, now)
        return gateway.command(CmdVel(header, Twist(), term, holder, False, stamp, NEVER_STOPPED, STD.grant_s), now)

    assert command(2, NO_TERM) is None, "before any term, nobody holds it"
    gateway.fence(Fence(LOW, HIGH), now)
    assert command(2, HIGH) is None
    assert command(3, HIGH) == "two_holders"
    assert command(2, HIGH) is None
