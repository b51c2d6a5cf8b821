"""Actions of a candidate: PREPARE, promises, fences, the first PROPOSE and its grants (E6, E10, E15, E16, E18-E21)."""

from __future__ import annotations

from lfa.protocol.lease.candidate import Candidate
from lfa.protocol.lease.effects import BecomeLeader
from lfa.protocol.lease.holder import Holder
from lfa.protocol.lease.machine import resigning
from lfa.protocol.lease.machine.memory import LeaseMemory, gateway_of
from lfa.protocol.lease.membership import led_by, unanimous_config
from lfa.protocol.lease.step_down import SLOWEST
from lfa.protocol.messages.consensus import Fence, Fenced, Grant, Member, Nack, Prepare, Promise, Propose, Term
from lfa.protocol.messages.header import WIRE_VERSION


def stand(m: LeaseMemory, now: float) -> None:
    """Start a candidacy under a term above all known ones. A leader does so too, to raise its term (E10)."""
    m.elect_after(now + m.timing.grant_s)
    bond = m.acceptor.bound(now)
    if bond is not None and bond.holder != m.me and not m.holder_gone():
        m.elect_after(bond.expiry)
        return
    number = max(m.seen.n, m.acceptor.promised.n) + 1
    term = Term(number, m.me.id, m.me.incarnation)
    m.candidate = Candidate(term, m.timing, now, m.election.forgotten(now))
    m.seen = term
    m.window.know(number)
    ask_promises(m, now)


def ask_promises(m: LeaseMemory, now: float) -> None:
    """Send PREPARE (again); the own voter answers first."""
    candidate = m.candidate
    assert candidate is not None
    candidate.asked(now)
    request = Prepare(candidate.term, m.config.version, candidate.forget, m.agreed, WIRE_VERSION)
    m.send("all", request)
    own = m.acceptor.prepare(m.me, request, m.config, now, m.holder_gone())
    if isinstance(own, Promise):
        on_promise(m, m.me, own, now)


def on_promise(m: LeaseMemory, src: Member, body: Promise, now: float) -> None:
    """Count a promise for the own term."""
    candidate = m.candidate
    if candidate is not None and body.term == candidate.term:
        candidate.promised(src, body.needs_fence, body.blank)
        _fence_or_propose(m, candidate, now)


def on_fenced(m: LeaseMemory, src: Member, body: Fenced, now: float) -> None:
    """Count a gateway's confirmation (E15); that of the own gateway may also complete an earlier step-down."""
    resigning.on_fenced(m, src, body, now)
    candidate = m.candidate
    if candidate is not None and body.term == candidate.term:
        candidate.fenced(src.id, body.old)
        _fence_or_propose(m, candidate, now)


def _fence_or_propose(m: LeaseMemory, candidate: Candidate, now: float) -> None:
    """Send FENCE for each lease that a promiser is bound to; start phase 2 when all gateways confirmed (E15)."""
    members: tuple[Member, ...] = ()
    candidate.fencing = False
    candidate.expects_nobody()
    if not candidate.has_quorum(m.config):
        members = m.election.without_quorum(candidate, m.config, m.peers, now)
        if m.me not in members:
            return
    for grantee in candidate.fences_to_ask(m.me):
        m.send(gateway_of(grantee.holder.id), Fence(grantee.term, candidate.term))
    if candidate.unfenced(m.me):
        candidate.fencing = True
        return
    candidate.holder = Holder(m.me, candidate.term, m.timing, now, m.agreed, candidate.fenced_terms)
    config = (
        unanimous_config(m.config, m.me, candidate.term, members)
        if members
        else led_by(m.config, m.me, candidate.term, m.peers.is_gone)
    )
    resigning.adopt(m, config, now)
    ask_grants(m, now)


def ask_grants(m: LeaseMemory, now: float) -> None:
    """Send PROPOSE (again); without the own voter's grant the candidacy is in vain."""
    assert m.candidate is not None and m.candidate.holder is not None
    holder = m.candidate.holder
    own = next_round(m, holder, now)
    if own is None:
        resigning.drop_candidacy(m, now)
    else:
        count(m, holder, m.me, own, now)


def next_round(m: LeaseMemory, holder: Holder, now: float) -> Grant | None:
    """Send one PROPOSE to all and return the own voter's grant; None, and nothing is sent, if that one refuses."""
    propose = holder.next_propose(m.config, now)
    own = m.acceptor.propose(m.me, propose, m.config, now)
    if not isinstance(own, Grant):
        return None
    m.send("all", propose)
    return own


def count(m: LeaseMemory, holder: Holder, src: Member, grant: Grant, now: float) -> None:
    """Count a grant for the candidacy; with a quorum's, lead until the expiry that follows from the request (E2)."""
    if not holder.granted(src, grant, m.config, now) or holder.expiry is None:
        return
    m.election.held(now)
    if now >= holder.expiry:
        return
    if m.candidate is not None and m.candidate.transferred:
        config = led_by(m.config, m.me, holder.term, m.peers.is_gone, keep_leader=True)
        resigning.adopt(m, config, now)
    m.candidate, m.holder = None, holder
    m.leader = m.me.id
    m.effects.append(BecomeLeader(holder.term, holder.expiry))


def take_over(m: LeaseMemory, body: Propose, own: Grant, now: float) -> None:
    """Take over a term handed to this process; count its grants, also those that came before the PROPOSE (E16)."""
    if body.nonce is None or m.holder is not None or m.candidate is not None:
        return
    candidate = Candidate(body.term, m.timing, now)
    candidate.transferred = True
    candidate.holder = Holder(m.me, body.term, m.timing, now, m.agreed)
    candidate.holder.transferred(body.round, body.nonce)
    m.candidate = candidate
    early, m.early_grants = m.early_grants, []
    for src, grant in [(m.me, own), *early]:
        if m.candidate is candidate and grant.term == body.term:
            count(m, candidate.holder, src, grant, now)


# --- refused ------------------------------------------------------------------------------------------------------


def give_up(m: LeaseMemory, _src: Member, body: Nack, now: float) -> None:
    """Adopt the config of the refusal if newer, and stand again under a higher term after a rank step."""
    resigning.adopt(m, body.config, now)
    give_up_late(m, now)


def give_up_late(m: LeaseMemory, now: float) -> None:
    """Give up the candidacy, and stand again after a rank step."""
    resigning.drop_candidacy(m, now)
    m.elect_after(now + m.timing.rank_step_s)


def give_up_without_quorum(m: LeaseMemory, src: Member, _body: Nack, now: float) -> None:
    """Give up if the voters that have not refused are no quorum (E6)."""
    assert m.candidate is not None
    if m.candidate.refused(src, m.config, m.peers.has_ended):
        give_up_late(m, now)


def ask_again(m: LeaseMemory, _src: Member, body: Nack, now: float) -> None:
    """Adopt the newer config and ask for promises under it at once; give up if it has retired this robot (E34)."""
    resigning.adopt(m, body.config, now)
    if not m.election.may_lead(m.config, m.me.id):
        give_up_late(m, now)
    elif m.candidate is not None and m.candidate.forget and now >= m.election.forget_until:
        forget_over(m, now)
    else:
        ask_promises(m, now)


def wait_for_bond(m: LeaseMemory, _src: Member, body: Nack, now: float) -> None:
    """Ask again when the refusing voter's bond has ended by any clock."""
    assert m.candidate is not None
    m.candidate.wait_until(now + body.remaining_s * SLOWEST)


def raise_term(m: LeaseMemory, _src: Member, body: Nack, now: float) -> None:
    """Adopt the config of the refusal if newer; who still leads raises its term above the promised one (E10)."""
    resigning.adopt(m, body.config, now)
    if m.holder is not None:
        stand(m, now)


def adopt_refusal(m: LeaseMemory, _src: Member, body: Nack, now: float) -> None:
    """Adopt the newer config of the refusal."""
    resigning.adopt(m, body.config, now)


def follow_refusal(m: LeaseMemory, _src: Member, body: Nack, now: float) -> None:
    """Adopt the newer config. A holder under it, if any, sends within a heartbeat, or this refusal names it."""
    resigning.adopt(m, body.config, now)
    m.elect_after(now + max(body.remaining_s * SLOWEST, m.timing.heartbeat_s))


# --- an operator's word -------------------------------------------------------------------------------------------


def forget(m: LeaseMemory, lost: tuple[Member, ...], now: float) -> None:
    """Apply an operator's declaration that the incarnations `lost` are dead, for one attempt of each robot (E20)."""
    silence_s = m.timing.remove_silence_s
    lost = tuple(m.peers.last_of(gone, now, silence_s) for gone in lost if gone.id in m.election.all_member_ids)
    if m.leader is None and lost and not m.lives_on(lost):
        resigning.drop_candidacy(m, now)
        m.election.forget(lost, now)
        m.elect_after(now)


def forget_over(m: LeaseMemory, now: float) -> None:
    """Give up an attempt that relies on a declaration that is void by now."""
    resigning.drop_candidacy(m, now)
    m.elect_after(now)
