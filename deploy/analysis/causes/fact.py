"""A fact of a run, the kinds of facts, and the order in which they happened."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

from msgspec import Struct

from lfa.protocol.names import WITNESS_NAME
from lfa.protocol.topics import WORLD_NAME

FactKind = Literal[
    # roots: nothing in a trace explains them
    "died", "stalled", "left", "cut", "lossy", "hardware silent", "order", "obstacle", "goal reached", "start",
    # links of a chain
    "lease lost", "input lost", "stuck", "left out", "deaf", "decision", "formation", "takeover",
    # what `lfa why` is asked about
    "leader change", "stop", "contact", "wait",
]  # fmt: skip
EFFECTS: tuple[FactKind, ...] = ("leader change", "stop", "contact", "wait")
ROOTS: frozenset[FactKind] = frozenset(
    {"died", "stalled", "left", "cut", "lossy", "hardware silent", "order", "obstacle", "goal reached", "start"}
)
FAILURES: frozenset[FactKind] = frozenset({"died", "stalled", "cut", "lossy", "hardware silent"})
"""Roots that are faults; they are listed even if nothing came of them."""


class Fact(Struct, frozen=True):
    """One thing that happened, at `at_s` [s] of the run's time, to the process or robot `place`."""

    at_s: float
    kind: FactKind
    place: str
    """Name of a process (`robot2`, `world`, `witness`), or of a link `robot1>robot2`."""
    text: str
    """Sentence without time and full stop."""
    until_s: float | None = None
    """End [s] of what lasts; None: at once, or to the end of the run."""
    other: str = ""
    """Second process or body concerned: the former leader, the body touched, the silent part; empty: none."""
    evidence: str = ""
    """Messages that prove it, by sender and sequence number."""

    @property
    def places(self) -> frozenset[str]:
        """Names of the processes at a place: both ends of a link."""
        return frozenset(self.place.split(">"))


def called(name: str) -> str:
    """Return the name of a process or robot for a sentence: `robot 2`, `the witness`."""
    if name.startswith("robot") and name[5:].isdecimal():
        return f"robot {name[5:]}"
    return f"the {name}" if name in (WITNESS_NAME, WORLD_NAME) else name


def listed(names: Iterable[str]) -> str:
    """Return the names of processes as a list for a sentence, in their order."""
    words = [called(name) for name in sorted(names)]
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
