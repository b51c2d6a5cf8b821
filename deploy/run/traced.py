"""What a process of the arena did, in the few words that a column has room for."""

from __future__ import annotations

from protocol.effects import AdoptChain, BecomeLeader, Effect, Send, StepDown
from protocol.messages import Grant, Hello, LeaseBody, Propose, Term


def told(effect: Effect) -> str:
    """An effect in the few words that a column has room for."""
    match effect:
        case Send(to=to, body=body):
            detail = f" r{body.round}" if isinstance(body, Propose | Grant) else ""
            return f"{type(body).__name__.lower()} {body_term(body)}{detail} > {to}"
        case BecomeLeader(term=term):
            return f"LEADS {short(term)}"
        case StepDown(term=term, cause=cause):
            return f"STOPS {short(term)} {cause}"
        case AdoptChain(config=config):
            return f"chain {[m.id for m in config.chain]} v{short(config.version.term)}.{config.version.seq}"
    return "extends"


def body_term(body: LeaseBody) -> str:
    return "" if isinstance(body, Hello) else short(body.term)


def short(term: Term) -> str:
    return f"{term.n}.{term.issuer}"
