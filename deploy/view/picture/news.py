"""News of a run for the page: items in the order in which they came, each sent once to each viewer.

A viewer that comes late gets what is kept: the newest item of each name, and of the unnamed ones the last `KEPT_MAX`.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import takewhile
from typing import Any

KEPT_MAX = 3000
"""Largest number of items kept: some hours of events."""

Item = dict[str, Any]


class News:
    """Numbered items; `count` is the number of the newest."""

    def __init__(self) -> None:
        self.count = 0
        self._items: dict[int, Item] = {}
        self._named: dict[str, int] = {}

    def add(self, item: Item, name: str = "") -> None:
        """Append an item; with a `name` it replaces the earlier one of that name."""
        self.count += 1
        if name:
            self._items.pop(self._named.get(name, 0), None)
            self._named[name] = self.count
        self._items[self.count] = item
        if len(self._items) > KEPT_MAX:
            named = set(self._named.values())
            del self._items[next((n for n in self._items if n not in named), next(iter(self._items)))]

    def since(self, number: int) -> list[Item]:
        """Return the items after item `number`, in their order."""
        return [item for _, item in reversed(list(self._newer(number)))]

    def _newer(self, number: int) -> Iterator[tuple[int, Item]]:
        return takewhile(lambda pair: pair[0] > number, reversed(self._items.items()))
