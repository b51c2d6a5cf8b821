"""Other spellings of a key expression, which match the same keys (pure).

A router passes a subscription on to other routers once for all its clients: what one client declares again, in the same
words as another client, crosses no link. In other words it does, and so replaces what a link had lost.
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


def respelled(expression: str, random: Random) -> str:
    """Return a spelling of `expression` drawn from some 2^n, n its pairs of letters after the owner.

    `lfa/f/*/lease/all` may become `lfa/f/*/l$*eas$*e/al$*l`. An expression of wildcards alone has no other spelling.
    """
    parts = expression.split("/")
    if parts[-1] == "**" and len(parts) == TOPIC_AT:
        return "/".join([*parts[:-1], random.choice(RESTS)])
    return "/".join([*parts[:TOPIC_AT], *(_respelled(part, random) for part in parts[TOPIC_AT:])])


def _respelled(part: str, random: Random) -> str:
    if "*" in part:
        return part
    # Inside words only: `stop$*` would match `stop_state` too, and `robot1$*2` robot 112.
    pairs = pairwise(part)
    gaps = [random.choice(("", NOTHING)) if left.isalpha() and right.isalpha() else "" for left, right in pairs]
    return "".join(letter + gap for letter, gap in zip(part, [*gaps, ""], strict=True))
