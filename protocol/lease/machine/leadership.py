"""Actions of a leader: renewal rounds, grants, and changes of chain and voters (E2, E8-E10, E17)."""

from __future__ import annotations

from lfa.protocol.lease.effects import LeaseExtended
from lfa.protocol.lease.holder import Holder
from lfa.protocol.lease.machine import candidacy, resigning, voting
from lfa.protocol.lease.machine.memory import LeaseMemory
from lfa.protocol.lease.reconfiguration import reshaped
from lfa.protocol.messages.consensus import Grant, Hello, Member, Roster


def renew(m: LeaseMemory, now: float) -> None:
    """Send the next round. A raised term that was given up still binds the own voter: raise the term again (E10)."""
    assert m.holder is not None
    holder = m.holder
    own = candidacy.next_round(m, holder, now)
    if own is None:
        candidacy.stand(m, now)
    else:
        _extend(m, holder, m.me, own, now)


def reshape(m: LeaseMemory, now: float) -> None:
    """Write and propose the next config if chain or voters change (E8, E9, E17)."""
    change_roster(m, m.config.roster, now)


def change_roster(m: LeaseMemory, roster: Roster, now: float) -> None:
    """Write and propose the next config under `roster`, and chain and voters by it (E33, E34)."""
    holder = m.holder
    assert holder is not None
    calm, own = m.calm, roster is m.config.roster
    if own and calm.holds(m.config, holder, m.peers, m.left_out, holder.timing, now):
        holder.said_hello.clear()
        return
    newer = reshaped(m.config, holder, m.me, m.peers, m.left_out, m.policy, holder.timing, now, roster)
    if own and newer is m.config:
        calm.note(m.config, holder, m.me, m.peers, m.left_out)
    holder.said_hello.clear()
    if newer is not m.config:
        resigning.adopt(m, newer, now)
        renew(m, now)


def on_grant(m: LeaseMemory, src: Member, body: Grant, now: float) -> None:
    """Count a grant for the term asked for, or for the one held; keep one of a term still unknown."""
    asked = None if m.candidate is None else m.candidate.holder
    if asked is not None and asked.term == body.term:
        candidacy.count(m, asked, src, body, now)
    elif m.holder is not None and m.holder.term == body.term:
        _extend(m, m.holder, src, body, now)
    else:
        voting.keep_grant(m, src, body, now)


def _extend(m: LeaseMemory, holder: Holder, src: Member, grant: Grant, now: float) -> None:
    if not holder.granted(src, grant, m.config, now) or holder.expiry is None:
        return
    m.election.held(now)
    m.effects.append(LeaseExtended(holder.term, holder.expiry))
    if m.config.previous is not None and m.candidate is None:
        reshape(m, now)  # the joint config may be accepted by now


def on_hello(m: LeaseMemory, src: Member, body: Hello, now: float) -> None:
    """Take the sender in (E9)."""
    if note_hello(m, src, body, now):
        reshape(m, now)


def note_hello(m: LeaseMemory, src: Member, body: Hello, now: float) -> bool:
    """Note the sender, to be taken in with the next change; return False for strangers and earlier incarnations."""
    voting.answer_hello(m, src, body, now)
    if m.holder is None or not m.election.takes_in(m.config, src.id) or m.peers.later_than(src) is not None:
        return False
    m.holder.heard_at[src] = now
    if src not in m.holder.said_hello:
        m.holder.said_hello.append(src)
    return True
