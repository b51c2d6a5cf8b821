"""Conversion of lease effects and messages to facts for the checkers."""

from __future__ import annotations

from collections.abc import Callable

from lfa.deploy.analysis.verification.checker import Checker, Report
from lfa.protocol.lease.effects import AdoptChain, BecomeLeader, Effect, LeaseExtended, Send, StepDown
from lfa.protocol.messages.consensus import Grant, LeaseNote, Member, Promise, Propose, Release
from lfa.protocol.names import robot_id_of


def report_effect(
    report: Report, effect: Effect, me: Member, at: float, bound_until: float, true: Callable[[float], float]
) -> None:
    """Report the facts of an effect. `bound_until`: end of the bond by a grant of this call [s, true time]; it counts
    from the arrival of what was granted, also where the process took that late. `true`: maps node time to true time.
    """
    match effect:
        case BecomeLeader(term, expiry) | LeaseExtended(term, expiry):
            report(Checker.leads, at, me, term, true(expiry))
        case StepDown():
            report(Checker.leads_no_more, at, me)
        case AdoptChain(config):
            report(Checker.adopts, at, me, config)
        case Send(_, Propose() as body):
            report(Checker.proposes, at, me, body)
            if body.holder == me:  # implies the grant of its own voter
                own = Grant(body.term, body.round, body.config.version, 0.0)
                report(Checker.grants, at, me, own, bound_until)
        case Send(_, Grant() as body):
            report(Checker.grants, at, me, body, bound_until)
        case Send(_, Release() as body):
            report(Checker.releases, at, body.term)


def report_message(report: Report, note: LeaseNote, at: float) -> None:
    """Report the facts about the sender of a received message; a killed sender may not have journalled it itself."""
    source = robot_id_of(note.header.sender)
    if source is None:
        return
    sender = Member(source, note.header.incarnation)
    match note.body:
        case Propose() as body:
            report(Checker.proposes, at, sender, body)
        case Promise() as body:
            report(Checker.promises, at, sender, body)
        case Release() as body:
            report(Checker.releases, at, body.term)
