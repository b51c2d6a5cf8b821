"""Base of all invariant checkers: the facts that they receive, and the state of the fences.

Checkers observe true time and the output of each process and gateway, never internal state. The fuzzer feeds them
while a schedule runs; a recording of real processes can feed them as well.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set
from typing import Any, Protocol, TypeVarTuple

from msgspec import Struct

from lfa.protocol.lease.timing import Timing
from lfa.protocol.messages.consensus import Config, Grant, LeaseBody, Member, Promise, Propose, Term
from lfa.protocol.messages.robot import CmdVel
from lfa.protocol.messages.stop import StopOrder, StopWord

Arguments = TypeVarTuple("Arguments")

EARLY_S = 1e-6
"""Tolerance [s] for the rounding of clock conversions."""
LONG_AGO = float("-inf")
"""Time [s] before every event of a run."""


class Violation(Struct, frozen=True):
    """Violation of an invariant: its name, the true time [s] and a text with the cause."""

    name: str
    at: float
    text: str


class Checker:
    """Checker of one invariant.

    It overrides the methods of the facts that it needs; `violations` holds its results. `at` is always true time [s].
    """

    name = ""

    def __init__(self, timing: Timing) -> None:
        self.timing = timing
        self.violations: list[Violation] = []
        self.told: Callable[[Violation], None] | None = None
        """Function to call with each violation at its moment."""

    def broken(self, at: float, text: str) -> None:
        self.violations.append(Violation(self.name, at, text))
        if self.told is not None:
            self.told(self.violations[-1])

    def leads(self, at: float, who: Member, term: Term, until: float) -> None:
        """Record that `who` holds `term`, new or extended, until true time `until` [s] by its own clock."""

    def leads_no_more(self, at: float, who: Member) -> None:
        """Record that `who` stepped down, or that its process ended."""

    def adopts(self, at: float, who: Member, config: Config) -> None: ...

    def promises(self, at: float, who: Member, promise: Promise) -> None:
        """Record that a promise reached the candidate that `promise.term` names."""

    def proposes(self, at: float, who: Member, propose: Propose) -> None: ...

    def grants(self, at: float, voter: Member, grant: Grant, until: float) -> None:
        """Record that `voter` is bound to the holder of `grant.term` until true time `until` [s]."""

    def releases(self, at: float, term: Term) -> None:
        """Record that a RELEASE of `term` left its holder."""

    def hears_release(self, at: float, who: Member, term: Term) -> None:
        """Record that a RELEASE of `term` reached the voter `who` (simulations only)."""

    def says(self, at: float, who: Member, body: LeaseBody) -> None:
        """Record that `who` sends this PREPARE, promise, refusal or SUPERSEDED (simulations only)."""

    def hears_order(self, at: float, robot_id: int, incarnation: int, order: StopOrder) -> None:
        """Record that an order of the fleet stop reached that incarnation of a gateway (simulations only)."""

    def bars(self, at: float, robot_id: int, below: Term) -> None:
        """Record that the gateway of `robot_id` from now on refuses terms under `below`, by a fence or a command."""

    def gateway_starts(self, at: float, robot_id: int, shut_until: float) -> None: ...

    def names(self, at: float, robots: tuple[int, ...]) -> None:
        """Record the robots that the mission names; others take part if they are admitted (E33)."""

    def lives(self, at: float, who: Member) -> None:
        """Record that the process of incarnation `who` started."""

    def holds(self, at: float, who: Member, agreed: int) -> None:
        """Record the digest of what `who` holds to be agreed (E25)."""

    def speaks(self, at: float, who: Member) -> None:
        """Record that `who` speaks a version of the messages that its team cannot read (E35)."""

    def ends(self, at: float, who: Member) -> None:
        """Record that the process of incarnation `who` ended."""

    def parts(self, at: float, cuts: Set[tuple[int, int]]) -> None:
        """Record the links (from id, to id) that are cut from now on; all other links are open."""

    def wall_steps(self, at: float, host: int) -> None:
        """Record a step of a wall clock, which may affect only the order of terms over a total blackout."""

    def heals(self, at: float, step_s: float) -> None:
        """Record the end of the last fault: a quorum is connected, a round trip takes at most half of `step_s` [s]."""

    def over(self, at: float) -> None:
        """Record the end of the run: no more facts follow."""

    def obeys(self, at: float, robot_id: int, cmd: CmdVel, age: float) -> None:
        """Record that the gateway of `robot_id` accepted `cmd`, whose stamp is `age` [s] old by the gateway's clock."""

    def told_of_stop(self, at: float, agent: Member, by: int) -> None:
        """Record that `agent` was told of the fleet stop by its own gateway or by the agent of robot `by`.

        Not of complete agents, and not of recorded ones.
        """

    def stop_acknowledged(self, at: float, robot_id: int, word: StopWord) -> None:
        """Record that the gateway of `robot_id` acknowledged a stop that its agent knows too (E28, E30)."""

    def stop_forgotten(self, at: float, robot_id: int) -> None:
        """Record that neither gateway nor agent of `robot_id` knows what it acknowledged: both have restarted."""

    def resume_said(self, at: float, word: StopWord) -> None:
        """Record that an operator said this resume for the first time or again."""

    def turns(self, at: float, robot_id: int, word: StopWord) -> None:
        """Record that wheels of `robot_id` turn, by the twist that its gateway lets through, which knows `word`."""

    def meets(self, at: float, who: Member, other: Member) -> None:
        """Record that `who` was given the first message of `other` (simulations of leases only)."""

    def hinted(self, at: float, who: Member, about: Member) -> None:
        """Record that `who` saw the token of `about` appear or vanish, true or false (E15)."""


class Report(Protocol):
    """Receiver of a fact: a method of `Checker`, and its arguments."""

    def __call__(self, fact: Callable[[Checker, *Arguments], None], *arguments: *Arguments) -> None: ...


class CheckerGroup:
    """Checkers of one run. A fact reaches those of them that override its method, in their order."""

    def __init__(self, checkers: Sequence[Checker] = ()) -> None:
        self._hearing: dict[Callable[..., None], list[Callable[..., None]]] = {
            fact: [getattr(c, name) for c in checkers if getattr(type(c), name) is not fact]
            for name, fact in _FACTS.items()
        }

    def report(self, fact: Callable[[Checker, *Arguments], None], *arguments: *Arguments) -> None:
        """Call the method `fact` of each checker that has one of its own."""
        for hear in self._hearing[fact]:
            hear(*arguments)


_FACTS: dict[str, Callable[..., Any]] = {
    name: method
    for name, method in vars(Checker).items()
    if callable(method) and not name.startswith("_") and name != "broken"
}
"""Methods of the facts by their names."""


class Fences:
    """Terms that each gateway refuses at present; shared by the checkers of I1, I4 and I8."""

    def __init__(self) -> None:
        self._least: dict[int, Term] = {}
        self._least_ever: dict[int, Term] = {}
        self._shut_until: dict[int, float] = {}

    def bars(self, robot_id: int, below: Term) -> None:
        self._least[robot_id] = max(self._least.get(robot_id, below), below)
        self._least_ever[robot_id] = max(self._least_ever.get(robot_id, below), below)

    def gateway_starts(self, robot_id: int, shut_until: float) -> None:
        self._least.pop(robot_id, None)
        self._shut_until[robot_id] = shut_until

    def refuses(self, robot_id: int, term: Term, until: float) -> bool:
        """Return True if no command of `term` can move `robot_id` from now until `until` [s]."""
        least = self._least.get(robot_id)
        return (least is not None and term < least) or until <= self._shut_until.get(robot_id, LONG_AGO)

    def fenced(self, robot_id: int, term: Term) -> bool:
        """Return True if `term` was ever barred at `robot_id`, also by an earlier incarnation of its gateway.

        That incarnation's fence followed the promises of a quorum, so no lease of `term` has started since; leases
        started before have expired when the next incarnation of the gateway opens (E13).
        """
        least = self._least_ever.get(robot_id)
        return least is not None and term < least


class WithFences(Checker):
    """Checker that also tracks the fences of the gateways."""

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self.fences = Fences()

    def bars(self, at: float, robot_id: int, below: Term) -> None:
        self.fences.bars(robot_id, below)

    def gateway_starts(self, at: float, robot_id: int, shut_until: float) -> None:
        self.fences.gateway_starts(robot_id, shut_until)


def shown(one: Term | Member) -> str:
    """Return a term or an incarnation as a short text."""
    return f"({one.n},{one.issuer},{one.incarnation})" if isinstance(one, Term) else f"{one.id}/{one.incarnation}"
