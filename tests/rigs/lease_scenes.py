"""Initial states for tests of the lease: a voter, a lease with two other voters, a simulated team led by robot 1."""

from __future__ import annotations

from lfa.deploy.analysis.verification.checker import Checker
from lfa.deploy.analysis.verification.safety import SAFETY
from lfa.deploy.fuzz.lease_simulation import LeaseSimulation
from lfa.protocol.lease.acceptor import Acceptor
from lfa.protocol.lease.effects import BecomeLeader, Effect, Send
from lfa.protocol.lease.machine.lease import Lease, Observer
from lfa.protocol.lease.timing import timing_of
from lfa.protocol.messages.consensus import (
    Config,
    Grant,
    Hello,
    LeaseBody,
    Member,
    Nack,
    Prepare,
    Promise,
    Propose,
    Term,
    Version,
)
from lfa.protocol.mission import Leading, Mission

STD = timing_of("std")
TEAM = Mission(robots=(1, 2, 3, 4), leading=Leading(route_m=((1.0, 0.0),)))


class Team(LeaseSimulation):
    """Lease simulation with safety checkers, run until robot 1 leads, at 1 s or at `led_by` [s]."""

    def __init__(self, robots: int = 4, led_by: float = 1.0, **options: object) -> None:
        super().__init__(robots, **options)  # type: ignore[arg-type]
        self.checkers: list[Checker] = [checker(self.timing) for checker in SAFETY]
        self.listen(self.checkers)
        self.start_all().run(led_by)
        assert self.leaders() == [1]

    def safe(self) -> bool:
        found = [v for checker in self.checkers for v in checker.violations]
        assert not found, found
        return True

    def changes(self, since: float = 1.0) -> list[tuple[int, str]]:
        """Return each id that became leader or stepped down after `since`, with the name of the effect."""
        return [(who, type(effect).__name__) for at, who, effect in self.log if at > since]

    def led_at(self, since: float) -> float:
        """Return the true time [s] when a process first became leader after `since`."""
        return next(at for at, _, effect in self.log if at > since and isinstance(effect, BecomeLeader))


def config_of(term: Term, seq: int = 0) -> Config:
    """Return the config of four robots and the witness, all in their first incarnation."""
    chain = tuple(Member(i, 1) for i in TEAM.robots)
    tie = Member(0, 1)
    return Config(Version(term, seq), (*chain, tie), tie, None, chain)


OLD = config_of(Term(1, 1, 1))


def voter(now: float = 10.0) -> Acceptor:
    """Return a voter whose start-up wait is over."""
    return Acceptor(Term(), STD.grant_s, now - 1.0)


def ask(voter: Acceptor, who: Member, term: Term, now: float, number: int = 0) -> Grant | Nack | None:
    return voter.propose(who, Propose(term, config_of(term), number, who), OLD, now)


A, B = Member(1, 7), Member(2, 8)
LOW, HIGH = Term(5, 1, 7), Term(6, 2, 8)

OTHERS = (Member(0, 3), Member(2, 4))
ME, (WITNESS, OTHER) = Member(1, 7), OTHERS
TRIO = (ME, OTHER, WITNESS)
TWO = Mission(robots=(1, 2), leading=Leading(route_m=((1.0, 0.0),)))
"""Robot 1, robot 2 and the witness of `alone`, and their mission."""


def alone(observer: Observer | None = None, mission: Mission = TWO) -> Lease:
    """Return the lease of robot 1 of two, with a witness, after a HELLO of both others."""
    lease = Lease(ME, mission, STD, 0.0, 0, observer)
    for other in OTHERS:
        lease.receive(other, Hello(None, lease.agreed), 0.0)
    return lease


def sent(effects: list[Effect], kind: type) -> list[LeaseBody]:
    return [e.body for e in effects if isinstance(e, Send) and isinstance(e.body, kind)]


def proposed(lease: Lease, at: float) -> Propose:
    """Return the PROPOSE that the lease sends when both others promise at `at`."""
    [prepare] = sent(lease.tick(STD.grant_s), Prepare)
    assert isinstance(prepare, Prepare)
    promise = Promise(prepare.term, lease.config, None, True)
    effects = [e for other in OTHERS for e in lease.receive(other, promise, at)]
    [propose] = sent(effects, Propose)
    assert isinstance(propose, Propose)
    return propose


def elected(slow_s: float, mission: Mission = TWO) -> tuple[Lease, float, float, list[Effect]]:
    """Return the lease of robot 1, the time of its request, the time of the grants `slow_s` later, and the effects."""
    lease, asked_at = alone(mission=mission), STD.grant_s + 0.001
    propose = proposed(lease, asked_at)
    at = asked_at + slow_s
    grant = Grant(propose.term, propose.round, propose.config.version, 0.0)
    effects = [e for other in OTHERS for e in lease.receive(other, grant, at)]
    return lease, asked_at, at, effects


def led_by_other(lease: Lease, term: Term, now: float) -> Config:
    """Let the other robot lead under `term`, by a PROPOSE that this process grants; return its config."""
    config = Config(Version(term), TRIO, WITNESS, None, (OTHER, ME))
    effects = lease.receive(OTHER, Propose(term, config, 0, OTHER, agreed=lease.agreed), now)
    assert len(sent(effects, Grant)) == 1
    return config


def committed(mission: Mission = TWO) -> tuple[Lease, float]:
    """Return a lease whose config is joint with none any more and has been accepted by all, and when that was."""
    lease, _, at, effects = elected(slow_s=0.001, mission=mission)
    assert not lease.is_committed, "joint with the unanimous start"
    while not lease.is_committed:
        at = max(at, lease.next_deadline())
        newest = sent([*effects, *lease.tick(at)], Propose)[-1]
        assert isinstance(newest, Propose)
        grant = Grant(newest.term, newest.round, newest.config.version, at)
        effects = [effect for other in OTHERS for effect in lease.receive(other, grant, at)]
    return lease, at
