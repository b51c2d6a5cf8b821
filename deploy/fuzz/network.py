"""True time and a faulty network for leases in virtual time.

All random numbers come from one generator, so the same seed and the same calls give the same run. A message sent over a
cut link is lost; one already in transit arrives.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from random import Random

from lfa.deploy.analysis.verification.checker import Arguments, Checker, CheckerGroup
from lfa.deploy.fuzz.partition import Partitioned, place
from lfa.protocol.lease.effects import AdoptChain, BecomeLeader, Effect, Send, StandAside, StepDown
from lfa.protocol.messages.consensus import Grant, Hello, LeaseBody, Propose, Superseded, Term
from lfa.protocol.transport.link_model import LinkModel, Radio
from lfa.world.virtual_time import VirtualTime

Filter = Callable[[int, int, LeaseBody], float | None]
"""Function (from, to, body) -> extra delay [s]; None drops the message. A gateway's address is minus its robot's id."""
FAIR = Radio(delay_s=0.0003, jitter_s=0.0017)
"""Link conditions without a fault."""
Trace = Callable[[float, int, str], None]
"""Function (true time [s], id, text of the action) that writes a readable trace."""


class Network(Partitioned, VirtualTime):
    """Simulated network between `ids`: time, random numbers, link model, cuts.

    A gateway's address is minus its robot's id.
    """

    def __init__(self, seed: int, ids: tuple[int, ...], radio: Radio, gateways_at: int | None) -> None:
        """Create the network. `gateways_at` is the host of all gateways; None: each gateway is on its robot's host."""
        super().__init__()
        self.random = Random(seed)
        self.ids = ids
        self.link_model = LinkModel(radio, self.random)
        self.filter: Filter | None = None
        self.trace: Trace | None = None
        self._gateways_at = gateways_at
        self._places = {i: place(i) for i in ids}
        self.listen(())

    def listen(self, checkers: Sequence[Checker]) -> None:
        """Notify these checkers, and only these, of all events from now on."""
        self._report = CheckerGroup(checkers).report

    def report(self, fact: Callable[[Checker, *Arguments], None], *arguments: *Arguments) -> None:
        """Notify the checkers of a fact that another part of the simulation has observed."""
        self._report(fact, *arguments)

    # --- cuts --------------------------------------------------------------------------------------------------

    def cut(self, *groups: tuple[int, ...]) -> None:
        """Block all messages between different groups, in both directions; ids in no group form one group."""
        rest = tuple(i for i in self.ids if not any(i in g for g in groups))
        sides = [*groups, rest]
        self.part({(a, b) for one in sides for other in sides if one is not other for a in one for b in other})

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
        return self.link_model.delays(self._places[here], self._places[there])


def effect_text(effect: Effect) -> str:
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
