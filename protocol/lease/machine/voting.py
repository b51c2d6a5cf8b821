"""Actions of every process as voter and follower: answers to PREPARE, PROPOSE, RELEASE and HELLO (E1, E3-E5, E9)."""

from __future__ import annotations

from lfa.protocol.incarnations import is_later
from lfa.protocol.lease.machine import candidacy, resigning
from lfa.protocol.lease.machine.memory import LeaseMemory
from lfa.protocol.lease.membership import VOTERS_MAX, is_first
from lfa.protocol.lease.quorum import electors
from lfa.protocol.lease.timing import lengths_of
from lfa.protocol.messages.consensus import (
    NO_TERM,
    Grant,
    Hello,
    Member,
    Nack,
    Prepare,
    Promise,
    Propose,
    Release,
    Superseded,
    Term,
)
from lfa.protocol.messages.header import WIRE_VERSION
from lfa.protocol.names import robot_name

HELLO_HEARTBEATS = 3
"""Pause between two HELLOs, in heartbeats of the shortest lease that a holder may ask for: its `t_chain` must hold
five, and a follower does not know which lease it is (E36)."""
PATIENCE, FIRST_PATIENCE = 2.0, 20.0
"""Heartbeats that a voter waits for the lease of the candidate that it promised a term to: usually, and in the first
election."""


def on_prepare(m: LeaseMemory, src: Member, body: Prepare, now: float) -> None:
    """Promise, refuse, or stay silent before a candidate further back in a first election (E5)."""
    m.seen = max(m.seen, body.term)
    if stands_before(m, src, body):
        return
    if body.forget and m.lives_on(body.forget):
        m.refuse(src, body.term, now)
        return
    answer = m.acceptor.prepare(src, body, m.config, now, m.holder_gone())
    if answer is not None:
        m.send(robot_name(src.id), answer)
    if isinstance(answer, Promise):
        _yield_to(m, body.term, now)
        if m.candidate is None:
            m.elect_after(max(now + _patience_s(m), m.election.base))
    elif answer is not None and answer.remaining_s > 0.0:
        m.refused_prepare = (src, body)  # answered again when the bond ends: it may have overtaken the RELEASE


def _patience_s(m: LeaseMemory) -> float:
    """Return the time [s] to wait for the lease of a candidate that was promised a term, from its last PREPARE.

    A first election needs the promises of all (E18), and one candidate more undoes them. On a machine that starts many
    robots at once, answers take longer than two heartbeats, and candidates beat each other until it has less to do.
    """
    return (FIRST_PATIENCE if is_first(m.config) else PATIENCE) * m.timing.heartbeat_s


def stands_before(m: LeaseMemory, src: Member, body: Prepare) -> bool:
    """Return True if this process precedes the candidate `src` in the first election of a fleet (E5)."""
    first = is_first(m.config) and body.version == m.config.version and m.election.may_lead(m.config, m.me.id)
    if not first or m.pending_release.closing:
        return False
    mine, other = (m.election.rank(m.config, i, m.peers) for i in (m.me.id, src.id))
    return mine < other


def on_propose(m: LeaseMemory, src: Member, body: Propose, now: float) -> None:
    """Grant or refuse as a voter that the config names; follow the holder, or be it (E16)."""
    m.seen = max(m.seen, body.term)
    if body.term < m.gateway_term:
        # E24: under this term the own gateway would let nothing through, for as long as its leader leads.
        m.acceptor.promised = max(m.acceptor.promised, m.gateway_term)
        m.refuse(src, body.term, now)
        return
    named = m.me in electors(body.config)
    answer = m.acceptor.propose(src, body, m.config, now) if named else None
    if answer is None and body.config.version < m.config.version:
        answer = m.acceptor.refusal(body.term, m.config, now)
    if isinstance(answer, Nack):
        m.send(robot_name(src.id), answer)
        return
    if answer is not None and body.holder != m.me:
        m.send(robot_name(body.holder.id), answer)
    _yield_to(m, body.term, now)
    if answer is not None and body.holder != m.me:
        resigning.step_down(m, now, "deposed")  # the own voter has granted another holder
    resigning.adopt(m, body.config, now)
    if answer is not None and body.holder == m.me:
        candidacy.take_over(m, body, answer, now)
    m.leader = body.holder.id
    m.leader_until = m.acceptor.kept_until(body, now)
    m.election.held(now)
    m.elect_after(m.leader_until)


def hear_refusal(m: LeaseMemory, body: Nack, now: float) -> None:
    """Note the terms that a refusal names, and that a lease is held (E21)."""
    m.seen = max(m.seen, body.promised, body.config.version.term)
    if body.remaining_s > 0.0 and body.holder != m.me:
        m.election.held(now)


def on_release(m: LeaseMemory, _src: Member, body: Release, now: float) -> None:
    """End the bond of exactly this term, and start the election."""
    freed = m.acceptor.release(body.term)
    # A process without a vote has no bond, but waits for the known lease to expire.
    known = m.holder is None and body.term == m.config.version.term and m.acceptor.bound(now) is None
    if not (freed or known):
        return
    m.leader = None
    m.elect_after(now)
    _answer_refused(m, now)


def holder_vanished(m: LeaseMemory, now: float) -> None:
    """Start the election after the holder's token vanished; answer a PREPARE that came before that event (E15)."""
    if m.acceptor.bound(now) is not None and m.holder_gone():
        m.elect_after(now)
        _answer_refused(m, now)


def keep_grant(m: LeaseMemory, src: Member, body: Grant, _now: float) -> None:
    """Keep a grant whose PROPOSE, a hand-over, is still to come."""
    term = m.config.version.term if m.holder is None else m.holder.term
    if body.term > term:
        m.early_grants = [*m.early_grants[1 - VOTERS_MAX :], (src, body)]


def answer_hello(m: LeaseMemory, src: Member, body: Hello, now: float) -> None:
    """Answer with the newest config while no leader is known (E9); tell an earlier incarnation so (E23)."""
    if m.election.takes_in(m.config, src.id):
        m.hellos[src.id] = (src, now)
    later = m.peers.later_than(src)
    if later is not None:
        m.send(robot_name(src.id), Superseded(later))
    elif m.leader is None and (body.version is None or body.version < m.config.version) and _tells(m):
        m.refuse(src, NO_TERM, now)


def _tells(m: LeaseMemory) -> bool:
    """Return whether this process answers a HELLO: if it knows a config, in a small team, or as one of the first ids.

    Who remembers none has none to tell, but shows that it is there. In the first start of N robots N squared answers,
    each with the names of N robots, would come eight times a second.
    """
    ids = m.election.all_member_ids
    return not is_first(m.config) or len(ids) <= VOTERS_MAX or m.me.id in ids[:VOTERS_MAX]


def on_superseded(m: LeaseMemory, _src: Member, body: Superseded, now: float) -> None:
    """Note that others know a later incarnation, if this one sends HELLO: others never say it to a member in place."""
    if m.is_out(now):
        note_later(m, body.newest)


def note_later(m: LeaseMemory, incarnation: int) -> None:
    """Note a number of this process that others know, if it is later than the own one and all noted (E23)."""
    if is_later(incarnation, m.me.incarnation if m.superseded_by is None else m.superseded_by):
        m.superseded_by = incarnation


def say_hello(m: LeaseMemory, now: float) -> None:
    """Send HELLO if no grant binds this process or no leader's chain names it (E9)."""
    pause_s = HELLO_HEARTBEATS * lengths_of(m.timing)[0].heartbeat_s
    on_time = now < m.hello_at + pause_s  # so that late ticks do not accumulate
    m.hello_at = (m.hello_at if on_time else now) + pause_s
    if m.is_out(now) and not m.pending_release.closing:
        m.send(_greeted(m), Hello(None if is_first(m.config) else m.config.version, m.agreed, WIRE_VERSION))


def _greeted(m: LeaseMemory) -> str:
    """Return the receiver of a HELLO: all, or the leader alone that a robot in its chain without a vote follows.

    Only that leader counts its silence. To all, a team of N robots would hear N squared of them, eight times a second.
    """
    in_place = m.me in m.config.chain and m.me not in m.config.voters
    return "all" if m.leader is None or not in_place else robot_name(m.leader)


def lose_leader(m: LeaseMemory, _now: float) -> None:
    """Know of no leader: the lease of the last one has expired by the own clock."""
    m.leader = None


def _answer_refused(m: LeaseMemory, now: float) -> None:
    refused, m.refused_prepare = m.refused_prepare, None
    if refused is not None:
        on_prepare(m, *refused, now)


def _yield_to(m: LeaseMemory, term: Term, now: float) -> None:
    """Give up an own candidacy lower than `term`, which this process has promised or granted."""
    if m.candidate is not None and term > m.candidate.term:
        resigning.drop_candidacy(m, now)
        m.elect_after(now + _patience_s(m))
