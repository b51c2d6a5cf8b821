"""Who hears a key: the subscriptions of all simulated processes, and the receivers of each key as last found.

A team of N robots has some 20 N subscriptions and 20 N keys. So a subscription without a wildcard costs one look-up,
and only the some twenty expressions with one, which all robots share, are compared with a new key.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Generic, TypeVar

from lfa.protocol.topics import matches
from lfa.protocol.transport.link_model import Link, link_of

Receiver = TypeVar("Receiver")
Route = list[tuple[Receiver, Link | None]]
"""Receivers of a key in the order of their starts, and the radio link to each (None: not over radio)."""


class Routes(Generic[Receiver]):
    """Subscriptions of the processes that have been added and not removed."""

    def __init__(self) -> None:
        self._names: dict[Receiver, str] = {}
        """Name of each process, in the order of their starts."""
        self._place: dict[Receiver, int] = {}
        self._starts = 0
        self._exact: dict[str, set[Receiver]] = {}
        self._wild: dict[str, set[Receiver]] = {}
        self._known: dict[str, Route[Receiver]] = {}

    def add(self, receiver: Receiver, name: str) -> None:
        """Add the process `name`, which subscribes to nothing yet."""
        self._starts += 1
        self._names[receiver], self._place[receiver] = name, self._starts

    def change(self, receiver: Receiver, ended: Iterable[str], begun: Iterable[str]) -> None:
        """End and begin subscriptions of a process that has been added."""
        for expression in ended:
            self._hearing(expression).discard(receiver)
            self._forget(expression)
        for expression in begun:
            self._hearing(expression).add(receiver)
            self._forget(expression)

    def remove(self, receiver: Receiver, interests: Iterable[str]) -> None:
        """Remove a process with its subscriptions."""
        self.change(receiver, interests, ())
        del self._names[receiver], self._place[receiver]

    def of(self, key: str) -> Route[Receiver]:
        """Return who hears `key`."""
        route = self._known.get(key)
        if route is None:
            hear = set(self._exact.get(key, ()))
            for expression, receivers in self._wild.items():
                if receivers and matches(expression, key):
                    hear |= receivers
            names = self._names
            route = [(each, link_of(key, names[each])) for each in sorted(hear, key=self._place.__getitem__)]
            self._known[key] = route
        return route

    def _hearing(self, expression: str) -> set[Receiver]:
        return (self._wild if "*" in expression else self._exact).setdefault(expression, set())

    def _forget(self, expression: str) -> None:
        """Forget what is no longer so: who hears one key, or, after a change of a wildcard, who hears any."""
        if "*" in expression:
            self._known.clear()
        else:
            self._known.pop(expression, None)
