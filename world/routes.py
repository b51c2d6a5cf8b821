"""Who hears a key: the subscriptions of all simulated processes, and the receivers of each key as last found.

A team of N robots has some 20 N subscriptions and, in an election, as many keys as pairs of robots. So a subscription
without a wildcard costs one look-up, and of those with one a new key is compared only with those of its own ending.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Generic, TypeVar

from lfa.protocol.topics import matches
from lfa.protocol.transport.link_model import Link, link_of

Receiver = TypeVar("Receiver")
Route = list[tuple[Receiver, Link | None]]
"""Receivers of a key in the order of their starts, and the radio link to each (None: not over radio)."""

ANY = "*"
"""Ending of expressions that have a wildcard in it."""


class Routes(Generic[Receiver]):
    """Subscriptions of the processes that have been added and not removed."""

    def __init__(self) -> None:
        self._names: dict[Receiver, str] = {}
        """Name of each process, in the order of their starts."""
        self._place: dict[Receiver, int] = {}
        self._starts = 0
        self._exact: dict[str, set[Receiver]] = {}
        self._wild: dict[str, dict[str, set[Receiver]]] = {}
        """Receivers by expression, by what `_ending` returns for it."""
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
            own = _ending(key)
            for ending in (own, f"{own.partition('/')[0]}/{ANY}", ANY):
                for expression, receivers in self._wild.get(ending, {}).items():
                    if receivers and matches(expression, key):
                        hear |= receivers
            names = self._names
            route = [(each, link_of(key, names[each])) for each in sorted(hear, key=self._place.__getitem__)]
            self._known[key] = route
        return route

    def _hearing(self, expression: str) -> set[Receiver]:
        among = self._wild.setdefault(_ending(expression), {}) if "*" in expression else self._exact
        return among.setdefault(expression, set())

    def _forget(self, expression: str) -> None:
        """Forget what is no longer so: who hears one key, or, after a change of a wildcard, who hears any."""
        if "*" in expression:
            self._known.clear()
        else:
            self._known.pop(expression, None)


def _ending(expression: str) -> str:
    """Return what follows the owner in a key or expression: its topic, and the receiver or that it is a wildcard."""
    topic, *rest = expression.split("/")[3:] or [ANY]
    if "*" in topic:
        return ANY
    return "/".join((topic, ANY if any("*" in part for part in rest) else "/".join(rest)))
