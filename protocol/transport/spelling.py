"""Other spellings of a key expression, which match the same keys (pure).

A router passes a subscription on to other routers once for all its clients: what one client declares again, in the same
words as another client, crosses no link. In other words it does, and so replaces what a link had lost.

A member uses a few spellings of its own in turn, so that the rules of a secured router can name them all.
"""

from __future__ import annotations

from itertools import pairwise
from random import Random

NOTHING = "$*"
"""Zenoh's wildcard inside a part of a key: it matches any text, also none."""
TOPIC_AT = 3
"""First part that may be spelled otherwise: access rules name the parts before it, and admit all that lies below."""
RESTS = ("**", "*/**", "*/*/**")
"""Spellings of the rest of a key, for keys with at least two more parts, as all of the topic table have."""
TURNS = 3
"""Number of spellings that a member uses in turn: the one before is undeclared before it comes again."""


def respelled(expression: str, member: str, turn: int) -> str:
    """Return the spelling of `expression` that `member` (`robot3`) uses in this turn.

    It is one of some 2^n, n the pairs of letters after the owner: `lfa/f/*/lease/all` may become
    `lfa/f/*/l$*eas$*e/al$*l`. An expression of wildcards alone has no other spelling.
    """
    random = Random(f"{expression} {member} {turn % TURNS}")
    parts = expression.split("/")
    if parts[-1] == "**" and len(parts) == TOPIC_AT:
        return "/".join([*parts[:-1], random.choice(RESTS)])
    return "/".join([*parts[:TOPIC_AT], *(_respelled(part, random) for part in parts[TOPIC_AT:])])


def spellings(expression: str, member: str) -> set[str]:
    """Return all expressions that `member` may declare in order to follow `expression`."""
    return {expression, *(respelled(expression, member, turn) for turn in range(TURNS))}


def _respelled(part: str, random: Random) -> str:
    if "*" in part:
        return part
    # Inside words only: `stop$*` would match `stop_state` too, and `robot1$*2` robot 112.
    pairs = pairwise(part)
    gaps = [random.choice(("", NOTHING)) if left.isalpha() and right.isalpha() else "" for left, right in pairs]
    return "".join(letter + gap for letter, gap in zip(part, [*gaps, ""], strict=True))
