"""True time and a faulty network for leases in virtual time.

One heap of (true time, number, event). Everything random comes from one generator, so the same seed and the same calls
do the same. A message that leaves where something is cut is lost; one that is on its way arrives.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from heapq import heapify, heappop, heappush
from random import Random
from typing import Any, Self

from msgspec import Struct

from lfa.deploy.analysis.verification.checker import Checker, listeners
from lfa.protocol.lease.effects import AdoptChain, BecomeLeader, Effect, Send, StepDown
from lfa.protocol.messages.consensus import Grant, Hello, LeaseBody, Propose, Term

REORDER_S = 0.15
"""More than three heartbeats of the profile std."""


class SimulatedClock(Struct, frozen=True):
    """local = offset + rate * true."""

    offset: float = 0.0
    rate: float = 1.0

    def local(self, true: float) -> float:
        return self.offset + self.rate * true

    def true(self, local: float) -> float:
        return (local - self.offset) / self.rate


class LinkConditions(Struct):
    """What the network does to messages that leave now; times in seconds."""

    delay_min: float = 0.0003
    delay_max: float = 0.002
    loss: float = 0.0
    duplicate: float = 0.0
    tail: float = 0.0
    """Probability of an exponential delay on top, of mean `tail_mean`."""
    tail_mean: float = 0.05
    reorder: float = 0.0
    """Probability that a message is held back for up to `REORDER_S`: later ones overtake it."""
    hint_delay_max: float = 0.005

    def delays(self, random: Random) -> Sequence[float]:
        """How long each copy of a message takes; none when it is lost."""
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
"""(from, to, body) -> extra delay [s]; None loses the message. Gateways are addressed as minus their robot's id."""
Trace = Callable[[float, int, str], None]
"""(true time [s], id, what it did): for people."""


class Network:
    """Simulated network between `ids`: time, chance, link conditions and cuts. A gateway's address is minus its robot's id."""

    def __init__(self, seed: int, ids: tuple[int, ...], weather: LinkConditions, gateways_at: int | None) -> None:
        """`gateways_at`: the id on whose host all gateways are; None: each is on its robot's."""
        self.random = Random(seed)
        self.now = 0.0
        self.ids = ids
        self.weather = weather
        self.filter: Filter | None = None
        self.trace: Trace | None = None
        self.cuts: set[tuple[int, int]] = set()
        """Directed pairs of ids between which nothing passes."""
        self._gateways_at = gateways_at
        self._heap: list[tuple[float, int, Callable[..., None], tuple[Any, ...]]] = []
        self._number = 0
        self.listen(())

    def listen(self, checkers: Sequence[Checker]) -> None:
        """Tell these checkers, and only these, what happens from here on."""
        self._tell = listeners(checkers)

    # --- the course of time ------------------------------------------------------------------------------------

    def at(self, time: float, what: Callable[..., None], *arguments: Any) -> None:
        """`what(*arguments)` when true time reaches `time`."""
        self._number += 1
        heappush(self._heap, (time, self._number, what, arguments))

    def run(self, until: float) -> Self:
        """All that happens up to true time `until`."""
        while self._heap and self._heap[0][0] <= until:
            self.now, _, what, arguments = heappop(self._heap)
            what(*arguments)
        self.now = until
        return self

    def lose(self, by: float, arrivals: tuple[Callable[..., None], ...]) -> None:
        """What would arrive after true time `by`, by one of these calls, never does."""
        self._heap = [event for event in self._heap if event[0] <= by or event[2] not in arrivals]
        heapify(self._heap)

    # --- cuts --------------------------------------------------------------------------------------------------

    def cut(self, *groups: tuple[int, ...]) -> None:
        """Nothing passes between different groups, either way; ids in no group form one."""
        rest = tuple(i for i in self.ids if not any(i in g for g in groups))
        sides = [*groups, rest]
        self.part({(a, b) for one in sides for other in sides if one is not other for a in one for b in other})

    def part(self, pairs: set[tuple[int, int]]) -> None:
        """From now on nothing passes from the first to the second of each pair."""
        self.cuts |= pairs
        self._tell_cuts()

    def heal_partition(self, pairs: set[tuple[int, int]]) -> None:
        self.cuts -= pairs
        self._tell_cuts()

    def heal(self) -> None:
        self.cuts.clear()
        self._tell_cuts()

    def _tell_cuts(self) -> None:
        for tell in self._tell["parts"]:
            tell(self.now, self.cuts)

    # --- messages ----------------------------------------------------------------------------------------------

    def host_of_gateway(self, robot_id: int) -> int:
        return robot_id if self._gateways_at is None else self._gateways_at

    def delays(self, here: int, to: int) -> Sequence[float]:
        """How long each copy of a message takes from host `here`; none when it is lost."""
        there = to if to >= 0 else self.host_of_gateway(-to)
        if here == there:
            return (0.0001 + 0.0004 * self.random.random(),)
        if self.cuts and (here, there) in self.cuts:
            return ()
        return self.weather.delays(self.random)


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
