"""Actions that end a lease or a candidacy: expiry (E7), step-down and RELEASE (E4), hand-over (E16), a newer config."""

from __future__ import annotations

from lfa.protocol.lease.effects import AdoptChain, Cause, StepDown
from lfa.protocol.lease.holder import Holder
from lfa.protocol.lease.machine.memory import LeaseMemory, gateway_of
from lfa.protocol.messages.consensus import Config, Fence, Fenced, Grant, Member, Propose, Release, Term
from lfa.protocol.messages.header import WIRE_VERSION
from lfa.protocol.names import robot_name

NEVER = float("inf")


def expire(m: LeaseMemory, now: float) -> None:
    """Stop leading at the end of the lease.

    A leader that can send but not receive would keep its voters bound for ever: it becomes silent, and lets others
    stand first.
    """
    step_down(m, now, "expired")
    m.elect_after(now + m.timing.grant_s)


def step_down(m: LeaseMemory, now: float, cause: Cause, below: Term | None = None) -> None:
    """Stop leading and fence the own gateway below `below` (default: just above the term), before RELEASE (E4)."""
    holder, m.holder = m.holder, None
    if holder is None:
        return
    m.leader = None
    m.pending_release.begin(holder.term, now)
    m.effects.append(StepDown(holder.term, cause))
    m.send(gateway_of(m.me.id), Fence(holder.term, below or _just_above(holder.term)))


def drop_candidacy(m: LeaseMemory, now: float) -> None:
    """Give up the candidacy and release its grants, unless this robot may still move under another term."""
    candidate, m.candidate = m.candidate, None
    if candidate is None or candidate.holder is None or m.holder is not None:
        return
    if now >= m.pending_release.at_rest_at:
        m.acceptor.release(candidate.term)
        m.send("all", Release(candidate.term))


def adopt(m: LeaseMemory, config: Config, now: float) -> None:
    """Adopt `config` if newer; step down if another leads it, as the own lease is then fenced or expired.

    A candidate that it has retired gives up, however it came by the config (E34).
    """
    if config.version > m.config.version:
        if config.chain[0] != m.me:
            step_down(m, now, "deposed")
        m.config = config
        if not m.election.may_lead(config, m.me.id):
            drop_candidacy(m, now)
        m.effects.append(AdoptChain(config))


def on_fenced(m: LeaseMemory, src: Member, body: Fenced, now: float) -> None:
    """Complete the step-down when the own gateway confirms; other confirmations concern a candidate only."""
    if src.id == m.me.id and body.old == m.pending_release.unreleased:
        complete(m, now)


def complete(m: LeaseMemory, now: float) -> None:
    """Send RELEASE or the transfer proposal: the own gateway refuses the term, or its last command is too old."""
    term, transfer_proposal = m.pending_release.end()
    m.released = m.pending_release.closing
    if term is None:
        return
    own = None if transfer_proposal is None else m.acceptor.propose(m.me, transfer_proposal, m.config, now)
    if transfer_proposal is not None and isinstance(own, Grant):
        m.send("all", transfer_proposal)
        m.send(robot_name(transfer_proposal.holder.id), own)
        m.leader, m.leader_until = transfer_proposal.holder.id, now + m.timing.grant_s
    else:
        m.acceptor.release(term)
        m.send("all", Release(term))


def leave(m: LeaseMemory, now: float) -> None:
    """Exit cleanly: stop leading, give up the candidacy, stand never again."""
    m.pending_release.closing = True
    m.election.at = NEVER
    step_down(m, now, "released")
    drop_candidacy(m, now)
    m.released = m.pending_release.unreleased is None


def hand_over(m: LeaseMemory, now: float) -> None:
    """Stop, then ask the voters to bind themselves to the successor under a new term of this process (E16)."""
    m.pending_release.transfer_proposal = proposal = transfer(m, now)
    drop_candidacy(m, now)
    step_down(m, now, "handed_over", None if proposal is None else proposal.term)
    m.elect_after(now + m.timing.grant_s)


def transfer(m: LeaseMemory, now: float) -> Propose | None:
    """Return the transfer proposal, None if no successor answers.

    The successor's lease starts at its own nonce, so that only its own clock is used. The config stays unchanged,
    version included: the new leader writes a new one after its quorum.
    """
    assert m.holder is not None
    successor = successor_of(m, m.holder, now)
    if successor is None:
        return None
    member, nonce = successor
    m.seen = Term(max(m.seen.n, m.holder.term.n) + 1, m.me.id, m.me.incarnation)
    m.window.know(m.seen.n)
    return Propose(m.seen, m.config, 0, member, nonce=nonce, agreed=m.agreed, wire=WIRE_VERSION)


def successor_of(m: LeaseMemory, holder: Holder, now: float) -> tuple[Member, float] | None:
    """Return the first follower that may lead and was heard within t_chain, with the nonce of its last grant."""
    for member in m.config.chain[1:]:
        nonce = holder.nonces.get(member)
        fit = m.election.may_lead(m.config, member.id) and member in m.config.voters and not m.peers.is_gone(member)
        if fit and nonce is not None and not holder.silent(member, now, holder.timing.chain_silence_s):
            return member, nonce
    return None


def _just_above(term: Term) -> Term:
    """Return the least term above `term`."""
    return Term(term.n, term.issuer, term.incarnation + 1)
