"""What all checkers of invariants share: what they are told, and what they know about fences.

They see true time and what left each process and each gateway, nothing of anybody's state: the fuzzer feeds
them while a schedule runs, and a recording of real processes can feed them as well.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set

from msgspec import Struct

from lfa.protocol.lease.timing import Timing
from lfa.protocol.messages.consensus import Config, Grant, Member, Promise, Propose, Term
from lfa.protocol.messages.robot import CmdVel

EARLY_S = 1e-6
"""Rounding of clock conversions."""
LONG_AGO = float("-inf")


class Violation(Struct, frozen=True):
    """What was broken, when (true time [s]), and by what."""

    name: str
    at: float
    text: str


class Checker:
    """One invariant. It overrides what it needs to hear; `violations` is what it found."""

    name = ""

    def __init__(self, timing: Timing) -> None:
        self.timing = timing
        self.violations: list[Violation] = []

    def broken(self, at: float, text: str) -> None:
        self.violations.append(Violation(self.name, at, text))

    def leads(self, at: float, who: Member, term: Term, until: float) -> None:
        """`who` holds `term`, new or extended, and believes so until true time `until`."""

    def leads_no_more(self, at: float, who: Member) -> None:
        """It stepped down, or its process ended."""

    def adopts(self, at: float, who: Member, config: Config) -> None: ...

    def promises(self, at: float, who: Member, promise: Promise) -> None:
        """A promise reached the candidate that `promise.term` names."""

    def proposes(self, at: float, who: Member, propose: Propose) -> None: ...

    def grants(self, at: float, voter: Member, grant: Grant, until: float) -> None:
        """`voter` is bound to the holder of `grant.term` until true time `until`."""

    def releases(self, at: float, term: Term) -> None:
        """A RELEASE of `term` left its holder."""

    def bars(self, at: float, robot_id: int, below: Term) -> None:
        """The gateway of `robot_id` refuses every term under `below` from here on, by a fence or a command."""

    def gateway_starts(self, at: float, robot_id: int, shut_until: float) -> None: ...

    def lives(self, at: float, who: Member) -> None:
        """A process began."""

    def ends(self, at: float, who: Member) -> None:
        """A process ended."""

    def parts(self, at: float, cuts: Set[tuple[int, int]]) -> None:
        """From here on nothing passes over these links between ids, from and to, and everything over the others."""

    def wall_steps(self, at: float, host: int) -> None:
        """A wall clock was stepped, which nothing but the order of terms over a total blackout may feel."""

    def heals(self, at: float, step_s: float) -> None:
        """The last fault is over, a quorum is connected, and a message comes and is answered within half `step_s`."""

    def over(self, at: float) -> None:
        """Nothing more will be told."""

    def obeys(self, at: float, robot_id: int, cmd: CmdVel, age: float) -> None:
        """The gateway of `robot_id` let `cmd` through, whose stamp is `age` seconds old by the gateway's clock."""


def listeners(checkers: Sequence[Checker]) -> dict[str, list[Callable[..., None]]]:
    """By what there is to hear, the methods of those checkers that want to hear it."""
    return {
        name: [getattr(c, name) for c in checkers if getattr(type(c), name) is not getattr(Checker, name)]
        for name in vars(Checker)
        if not name.startswith("_")
    }


class Fences:
    """What each gateway refuses at a moment: the knowledge that I1, I4 and I8 share."""

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
        """No command of `term` moves `robot_id`, now and until `until`."""
        least = self._least.get(robot_id)
        return (least is not None and term < least) or until <= self._shut_until.get(robot_id, LONG_AGO)

    def fenced(self, robot_id: int, term: Term) -> bool:
        """`term` was barred at `robot_id`, be it by an earlier life of its gateway.

        That life's fence followed the promises of a quorum, so that no lease of `term` has begun since; and those
        begun before have run out when the next life opens (E13).
        """
        least = self._least_ever.get(robot_id)
        return least is not None and term < least


class WithFences(Checker):
    """A checker that has to know what is fenced."""

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self.fences = Fences()

    def bars(self, at: float, robot_id: int, below: Term) -> None:
        self.fences.bars(robot_id, below)

    def gateway_starts(self, at: float, robot_id: int, shut_until: float) -> None:
        self.fences.gateway_starts(robot_id, shut_until)


def term_text(term: Term) -> str:
    return f"({term.n},{term.issuer},{term.incarnation})"


def member_text(member: Member) -> str:
    return f"{member.id}/{member.incarnation}"
