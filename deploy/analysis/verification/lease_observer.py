"""Conversion of lease effects and messages to facts for the checkers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from lfa.protocol.lease.effects import AdoptChain, BecomeLeader, Effect, LeaseExtended, Send, StepDown
from lfa.protocol.messages.consensus import Grant, LeaseNote, Member, Promise, Propose, Release
from lfa.protocol.names import robot_id_of

Words = tuple[Any, ...]
"""Fact for the checkers: the name of a method of `Checker`, and its arguments."""


def effect_facts(
    effect: Effect, me: Member, at: float, bond_s: float, true: Callable[[float], float]
) -> Iterator[Words]:
    """Yield the facts of an effect. `bond_s`: a voter's bond [s, true time]. `true`: maps node time to true time."""
    match effect:
        case BecomeLeader(term, expiry) | LeaseExtended(term, expiry):
            yield ("leads", at, me, term, true(expiry))
        case StepDown():
            yield ("leads_no_more", at, me)
        case AdoptChain(config):
            yield ("adopts", at, me, config)
        case Send(_, Propose() as body):
            yield ("proposes", at, me, body)
            if body.holder == me:  # implies the grant of its own voter
                own = Grant(body.term, body.round, body.config.version, 0.0)
                yield ("grants", at, me, own, at + bond_s)
        case Send(_, Grant() as body):
            yield ("grants", at, me, body, at + bond_s)
        case Send(_, Release() as body):
            yield ("releases", at, body.term)


def message_facts(note: LeaseNote, at: float) -> Iterator[Words]:
    """Yield the facts about the sender of a received message; a killed sender may not have journalled it itself."""
    source = robot_id_of(note.header.sender)
    if source is None:
        return
    sender = Member(source, note.header.incarnation)
    match note.body:
        case Propose() as body:
            yield ("proposes", at, sender, body)
        case Promise() as body:
            yield ("promises", at, sender, body)
        case Release() as body:
            yield ("releases", at, body.term)
