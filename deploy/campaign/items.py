"""Item of a campaign: a task that depends on nothing but its own arguments, and the value that it leaves."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from typing import Any

import msgspec
from msgspec import Struct

NAME_DIGITS = 16
"""Hexadecimal digits of a name: among a million items two alike are as likely as 1 in 10^7."""


class ItemResult(Struct, frozen=True):
    """Value of an item that was done: data that JSON can hold, and why it is not good."""

    data: Any
    complaint: str = ""
    """Reason why the item failed; empty: it is good."""


class Item(Struct, frozen=True):
    """One piece of work. `measure` must be picklable: it is called in another process of this machine."""

    name: str
    label: str
    """Text of the item in messages, with what a person needs to do it again."""
    measure: Callable[[], ItemResult]


def name_of(facts: object) -> str:
    """Return the name of an item: a hash of everything that its result depends on, besides the version of `lfa`."""
    text = msgspec.json.encode(facts, order="deterministic")
    return hashlib.sha256(text).hexdigest()[:NAME_DIGITS]


def names_digest(names: list[str]) -> str:
    """Return the name of a campaign, from those of its items in their order."""
    return name_of(names)
