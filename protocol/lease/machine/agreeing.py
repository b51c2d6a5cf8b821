"""Actions between processes that hold different agreements: they refuse each other, and the odd one ends (E25)."""

from __future__ import annotations

from msgspec import structs

from lfa.protocol.lease.agreement import understands
from lfa.protocol.lease.effects import StandAside
from lfa.protocol.lease.machine.memory import LeaseMemory
from lfa.protocol.lease.membership import is_first
from lfa.protocol.messages.consensus import NO_TERM, Hello, Member, Nack, Prepare, Propose
from lfa.protocol.names import robot_name


def refuse_foreign(m: LeaseMemory, src: Member, body: Prepare | Propose | Hello, _now: float) -> None:
    """Answer with the own agreement; nothing else of the message is read.

    To a neighbour it is said in the neighbour's version, which would else take that for the difference (E35).
    """
    term = NO_TERM if isinstance(body, Hello) else body.term
    own = structs.replace(m.census.own, wire=body.wire) if understands(body.wire) else m.census.own
    m.send(robot_name(src.id), Nack(term, NO_TERM, None, 0.0, m.config, own))


def refused_as_foreign(m: LeaseMemory, src: Member, body: Nack, now: float) -> None:
    """Count the refusal; without a leader, stand aside for good if this process is the odd one."""
    assert body.agreement is not None
    m.census.other(src.id, body.agreement)
    reason = m.census.outvoted(is_first(m.config), now)
    if m.leader is None and reason is not None:
        m.effects.append(StandAside(reason))
