"""True time and a faulty network for leases in virtual time.

All random numbers come from one generator, so the same seed and the same calls give the same run. A message sent over a
cut link is lost; one already in transit arrives.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from random import Random

from msgspec import Struct

from lfa.deploy.analysis.verification.checker import Checker, CheckerGroup
from lfa.protocol.lease.effects import AdoptChain, BecomeLeader, Effect, Send, StandAside, StepDown
from lfa.protocol.messages.consensus import Grant, Hello, LeaseBody, Propose, Superseded, Term
from lfa.world.virtual_time import VirtualTime

REORDER_S = 0.15
"""Maximum delay [s] of a message held back; more than three heartbeats of the profile std."""


class LinkConditions(Struct):
    """Link conditions for messages sent now; times in seconds."""

    delay_min: float = 0.0003
    delay_max: float = 0.002
    loss: float = 0.0
    duplicate: float = 0.0
    tail: float = 0.0
    """Probability of an additional exponential delay of mean `tail_mean`."""
    tail_mean: float = 0.05
    reorder: float = 0.0
    """Probability that a message is held back for up to `REORDER_S`, so that later ones overtake it."""
    hint_delay_max: float = 0.005

    def delays(self, random: Random) -> Sequence[float]:
        """Return the delay [s] of each copy of a message; empty if it is lost."""
        chance = random.random
        if self.loss and chance() < self.loss:
            return ()
        delay = self.delay_min + (self.delay_max - self.delay_min) * chance()
        if self.tail and chance() < self.tail:
            delay += random.expovariate(1.0 / self.tail_mean)
        if self.reorder and chance() < self.reorder:
            delay += REORDER_S * chance()
        if self.duplicate and chance() < self.duplicate:
            return delay, delay + 2.0 * self.tail_mean * chance()
        return (delay,)


Filter = Callable[[int, int, LeaseBody], float | None]
"""Function (from, to, body) -> extra delay [s]; None drops the message. A gateway's address is minus its robot's id."""
Trace = Callable[[float, int, str], None]
"""Function (true time [s], id, text of the action) that writes a readable trace."""


class Network(VirtualTime):
    """Simulated network between `ids`: time, random numbers, link conditions, cuts.

    A gateway's address is minus its robot's id.
    """

    def __init__(self, seed: int, ids: tuple[int, ...], weather: LinkConditions, gateways_at: int | None) -> None:
        """Create the network. `gateways_at` is the host of all gateways; None: each gateway is on its robot's host."""
        super().__init__()
        self.random = Random(seed)
        self.ids = ids
        self.weather = weather
        self.filter: Filter | None = None
        self.trace: Trace | None = None
        self.cuts: set[tuple[int, int]] = set()
        """Directed pairs of ids between which no message passes."""
        self._gateways_at = gateways_at
        self.listen(())

    def listen(self, checkers: Sequence[Checker]) -> None:
        """Notify these checkers, and only these, of all events from now on."""
        self._report = CheckerGroup(checkers).report

    # --- cuts --------------------------------------------------------------------------------------------------

    def cut(self, *groups: tuple[int, ...]) -> None:
        """Block all messages between different groups, in both directions; ids in no group form one group."""
        rest = tuple(i for i in self.ids if not any(i in g for g in groups))
        sides = [*groups, rest]
        self.part({(a, b) for one in sides for other in sides if one is not other for a in one for b in other})

    def part(self, pairs: set[tuple[int, int]]) -> None:
        """Block all messages from the first to the second id of each pair."""
        self.cuts |= pairs
        self._tell_cuts()

    def heal_partition(self, pairs: set[tuple[int, int]]) -> None:
        """Remove the cuts of these directed pairs."""
        self.cuts -= pairs
        self._tell_cuts()

    def heal(self) -> None:
        """Remove all cuts."""
        self.cuts.clear()
        self._tell_cuts()

    def _tell_cuts(self) -> None:
        self._report(Checker.parts, self.now, self.cuts)

    # --- messages ----------------------------------------------------------------------------------------------

    def host_of_gateway(self, robot_id: int) -> int:
        """Return the id of the host on which a robot's gateway runs."""
        return robot_id if self._gateways_at is None else self._gateways_at

    def delays(self, here: int, to: int) -> Sequence[float]:
        """Return the delay [s] of each copy of a message from host `here` to the address `to`; empty if it is lost."""
        there = to if to >= 0 else self.host_of_gateway(-to)
        if here == there:
            return (0.0001 + 0.0004 * self.random.random(),)
        if self.cuts and (here, there) in self.cuts:
            return ()
        return self.weather.delays(self.random)


def told(effect: Effect) -> str:
    """Return a short text of an effect that fits a column of the trace."""
    match effect:
        case Send(to=to, body=body):
            detail = f" r{body.round}" if isinstance(body, Propose | Grant) else ""
            return f"{type(body).__name__.lower()} {body_term(body)}{detail} > {to}"
        case BecomeLeader(term=term):
            return f"LEADS {short(term)}"
        case StepDown(term=term, cause=cause):
            return f"STOPS {short(term)} {cause}"
        case StandAside(reason=reason):
            return f"ENDS {reason}"
        case AdoptChain(config=config):
            return f"chain {[m.id for m in config.chain]} v{short(config.version.term)}.{config.version.seq}"
    return "extends"


def body_term(body: LeaseBody) -> str:
    """Return the term of a message as text; empty for HELLO and its answer, which have none."""
    return "" if isinstance(body, Hello | Superseded) else short(body.term)


def short(term: Term) -> str:
    """Return a term as text without its issuer's incarnation."""
    return f"{term.n}.{term.issuer}"
