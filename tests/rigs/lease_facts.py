"""Facts of a small team as the checkers of the lease's invariants are told them: configs, votes, commands."""

from __future__ import annotations

from lfa.deploy.analysis.verification.checker import Checker
from lfa.protocol.geometry import STILL
from lfa.protocol.lease.timing import timing_of
from lfa.protocol.messages.consensus import (
    Config,
    Electorate,
    GatewayStamp,
    Grant,
    Member,
    Propose,
    Roster,
    Term,
    Version,
)
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import CmdVel

STD = timing_of("std")
ONE, TWO, THREE, FOUR = (Member(n, 1) for n in (1, 2, 3, 4))
LOW, MIDDLE, HIGH = Term(1, 1, 1), Term(2, 2, 1), Term(3, 3, 1)
TEAM = (ONE, TWO, THREE)
OLD, NEW = Electorate(TEAM), (*TEAM, FOUR)
"""Electorate of the team, and voters with a fourth."""
NOTHING = Roster()


def config(
    term: Term = LOW,
    seq: int = 0,
    voters: tuple[Member, ...] = TEAM,
    previous: Electorate | None = None,
    *,
    tie: Member | None = None,
    chain: tuple[Member, ...] = TEAM,
    roster: Roster = NOTHING,
) -> Config:
    return Config(Version(term, seq), voters, tie, previous, chain, roster)


def command(term: Term, holder: int, *, as_leader: bool = True) -> CmdVel:
    return CmdVel(Header(f"robot{holder}", 1, 1, 0.0), STILL, term, holder, as_leader, GatewayStamp(1, 0.0))


def propose(term: Term, holder: Member, round_number: int = 0, conf: Config | None = None) -> Propose:
    return Propose(term, conf or config(term), round_number, holder)


def grant(term: Term, seq: int = 0) -> Grant:
    return Grant(term, 0, Version(term, seq), 0.0)


def found(checker: Checker) -> int:
    return len(checker.violations)
