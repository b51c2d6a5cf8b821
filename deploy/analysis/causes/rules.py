"""The rules by which one fact may cause another, and the search for the shortest chain from an effect to a root.

A cause never begins after its effect, and it concerns a process of the effect: the same, its second one, or one end of
a link. Among the causes of one fact, the rule listed first wins, then the nearest in time. A chain that ends at a root
is preferred to one that ends anywhere else, and a shorter one to a longer one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from msgspec import Struct

from lfa.deploy.analysis.causes.fact import ROOTS, Fact, FactKind

LET_GO = ("resume", "go")
"""Orders that let robots drive on: none of them is the cause of a stop."""

Where = Literal["same", "other", "touches", "anywhere"]
"""Process of a cause: the effect's own, its second one, either of these, or any."""
SLACK_S = 0.02
"""Time [s] by which a cause may seem to begin after its effect: delay of a message, and the grid of the world."""
STEPS_MAX = 6


class CausalRule(Struct, frozen=True):
    """A `cause` at `where` that began, or still lasted, up to `within_s` [s] before the effect may have caused it."""

    effect: FactKind
    cause: FactKind
    where: Where
    within_s: float
    other: str = ""
    """Second process or part that the cause must name; empty: any."""


#    effect           cause              where       within_s
RULES: tuple[CausalRule, ...] = (
    CausalRule("leader change", "died",            "other",    10.0),
    CausalRule("leader change", "left",            "other",    10.0),
    CausalRule("leader change", "lease lost",      "other",    10.0),
    CausalRule("leader change", "stalled",         "other",    10.0),
    CausalRule("leader change", "cut",             "other",    10.0),
    CausalRule("leader change", "hardware silent", "other",     5.0, "driver"),
    CausalRule("leader change", "stuck",           "other",    10.0),
    CausalRule("leader change", "lossy",           "other",     5.0),
    CausalRule("leader change", "stalled",         "anywhere",  5.0),
    CausalRule("leader change", "died",            "anywhere",  5.0),
    CausalRule("leader change", "lossy",           "anywhere",  5.0),

    CausalRule("lease lost",    "left",            "same",      3.0),
    CausalRule("lease lost",    "order",           "anywhere",  2.0),
    CausalRule("lease lost",    "stalled",         "same",      1.0),
    CausalRule("lease lost",    "input lost",      "same",      6.0),
    CausalRule("lease lost",    "stuck",           "same",      6.0),
    CausalRule("lease lost",    "hardware silent", "same",      6.0),
    CausalRule("lease lost",    "cut",             "touches",   2.0),
    CausalRule("lease lost",    "died",            "anywhere",  2.0),
    CausalRule("lease lost",    "lossy",           "touches",   2.0),
    CausalRule("lease lost",    "stalled",         "anywhere",  2.0),

    CausalRule("stuck",         "hardware silent", "same",     60.0),
    CausalRule("stuck",         "input lost",      "same",     10.0),
    CausalRule("stuck",         "contact",         "same",      5.0),
    CausalRule("stuck",         "obstacle",        "same",     12.0),

    CausalRule("input lost",    "hardware silent", "same",     60.0),
    CausalRule("input lost",    "stalled",         "same",      2.0),
    CausalRule("input lost",    "stalled",         "anywhere",  2.0),

    CausalRule("left out",      "stuck",           "same",     60.0),
    CausalRule("left out",      "input lost",      "same",     60.0),

    CausalRule("deaf",          "leader change",   "other",     2.0),
    CausalRule("deaf",          "stalled",         "same",      1.0),
    CausalRule("deaf",          "cut",             "touches",   2.0),
    CausalRule("deaf",          "died",            "anywhere",  3.0),

    CausalRule("wait",          "obstacle",        "same",      0.1),
    CausalRule("wait",          "order",           "same",      3.0, "retire"),
    CausalRule("wait",          "left",            "anywhere",  2.0),
    CausalRule("wait",          "died",            "anywhere",  2.0),
    CausalRule("wait",          "cut",             "touches",   5.0),
    CausalRule("wait",          "lease lost",      "anywhere",  2.0),
    CausalRule("wait",          "stalled",         "anywhere",  3.0),
    CausalRule("wait",          "leader change",   "anywhere",  1.0),
    CausalRule("wait",          "left out",        "same",      1.0),
    CausalRule("wait",          "lossy",           "anywhere",  3.0),

    CausalRule("stop",          "died",            "same",      1.5),
    CausalRule("stop",          "stalled",         "same",      1.5),
    CausalRule("stop",          "left",            "same",      1.5),
    CausalRule("stop",          "hardware silent", "same",      4.0),
    CausalRule("stop",          "input lost",      "same",      3.0),
    CausalRule("stop",          "stuck",           "same",      4.0),
    CausalRule("stop",          "order",           "anywhere",  2.0),
    CausalRule("stop",          "lease lost",      "same",      1.5),
    CausalRule("stop",          "contact",         "same",      1.0),
    CausalRule("stop",          "cut",             "touches",   3.0),
    CausalRule("stop",          "died",            "other",     3.0),
    CausalRule("stop",          "stalled",         "other",     3.0),
    CausalRule("stop",          "left",            "other",     3.0),
    CausalRule("stop",          "leader change",   "anywhere",  1.5),
    CausalRule("stop",          "stalled",         "anywhere",  1.5),
    CausalRule("stop",          "wait",            "same",      1.5),
    CausalRule("stop",          "decision",        "same",      3.0),
    CausalRule("stop",          "stop",            "other",     4.0),
    CausalRule("stop",          "lossy",           "touches",   2.0),
    CausalRule("stop",          "died",            "anywhere",  5.0),
    CausalRule("stop",          "left out",        "same",      3.0),
    CausalRule("stop",          "stop",            "anywhere", 15.0),
    CausalRule("stop",          "stuck",           "anywhere", 15.0),
    CausalRule("stop",          "lossy",           "anywhere",  5.0),
    CausalRule("stop",          "formation",       "anywhere",  3.0),
    CausalRule("stop",          "obstacle",        "same",      5.0),

    CausalRule("decision",      "obstacle",        "same",      0.1),

    CausalRule("contact",       "hardware silent", "same",     10.0),
    CausalRule("contact",       "stalled",         "touches",   2.0),
    CausalRule("contact",       "died",            "touches",  60.0),
    CausalRule("contact",       "hardware silent", "other",    10.0),
    CausalRule("contact",       "lossy",           "touches",   2.0),
    CausalRule("contact",       "cut",             "touches",   5.0),
    CausalRule("contact",       "leader change",   "anywhere",  5.0),
    CausalRule("contact",       "stop",            "other",     5.0),
    CausalRule("contact",       "decision",        "same",      3.0),
    CausalRule("contact",       "obstacle",        "same",      5.0),
    CausalRule("contact",       "formation",       "anywhere",  5.0),
)  # fmt: skip


class CauseChain(Struct, frozen=True):
    """Facts from the root to the effect, each the cause of the next; of one fact only when no cause was found."""

    facts: tuple[Fact, ...]

    @property
    def effect(self) -> Fact:
        return self.facts[-1]

    @property
    def root(self) -> Fact | None:
        """The fact that nothing in the trace explains; None if the chain ends at none of those."""
        return self.facts[0] if self.facts[0].kind in ROOTS else None


def explain(effect: Fact, known: Sequence[Fact]) -> CauseChain:
    """Return the shortest chain of causes of `effect` among the `known` facts, breadth first."""
    paths: list[tuple[Fact, ...]] = [(effect,)]
    seen = {effect}
    longest = paths[0]
    for _ in range(STEPS_MAX):
        further: list[tuple[Fact, ...]] = []
        for path in paths:
            for cause in causes(path[0], known):
                if cause in seen:
                    continue
                seen.add(cause)
                if cause.kind in ROOTS:
                    return CauseChain((cause, *path))
                further.append((cause, *path))
        if not further:
            break
        paths, longest = further, further[0]
    return CauseChain(longest)


def causes(effect: Fact, known: Sequence[Fact]) -> list[Fact]:
    """Return the facts that may have caused `effect`, the most likely first."""
    found: list[Fact] = []
    for rule in RULES:
        if rule.effect == effect.kind:
            found += sorted((fact for fact in known if _fits(rule, fact, effect)), key=lambda fact: -fact.at_s)
    return found


def _fits(rule: CausalRule, cause: Fact, effect: Fact) -> bool:
    if cause.kind != rule.cause or cause == effect or (rule.other and cause.other != rule.other):
        return False
    if (effect.kind, cause.kind) == ("stop", "order") and cause.other in LET_GO:
        return False
    if cause.at_s > effect.at_s + SLACK_S or (cause.kind == effect.kind and cause.at_s >= effect.at_s):
        return False
    ended_s = cause.at_s if cause.until_s is None and cause.kind not in _LASTING else cause.until_s
    if ended_s is not None and effect.at_s - ended_s > rule.within_s:
        return False
    match rule.where:
        case "same":
            return effect.place in cause.places
        case "other":
            return effect.other != "" and effect.other in cause.places
        case "touches":
            return bool(cause.places & (effect.places | {effect.other}))
        case "anywhere":
            return True


_LASTING = ("cut", "lossy", "hardware silent", "stalled")
"""Facts that last to the end of the run if they have no end."""
