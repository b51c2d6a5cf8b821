"""Who hears a key: the subscriptions of all simulated processes, and the receivers of each key as last found.

A team of N robots has some 20 N subscriptions and, in an election, as many keys as pairs of robots. So a subscription
without a wildcard costs one look-up, of those with one a new key is compared only with those of its own ending, and
keys that the same expressions match share one list of receivers.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Generic, NamedTuple, TypeVar

from lfa.protocol.topics import matches
from lfa.protocol.transport.link_model import ends_of, place_of

Receiver = TypeVar("Receiver")


class KeyReceivers(NamedTuple, Generic[Receiver]):
    """Way of the messages on a key."""

    sender: str | None
    """Place that they are sent from; None: they cross no link."""
    receivers: list[tuple[Receiver, str]]
    """Receivers in the order of their starts, each with the place at which it hears them."""


ANY = "*"
"""Ending of expressions that have a wildcard in it."""


class _Way(NamedTuple):
    """What no change of a subscription to known expressions changes: ends of a key, and what expressions match it."""

    sender: str | None
    place: str | None
    """Place at which all hear it; None: each at its own."""
    matching: tuple[str, ...]


class Routes(Generic[Receiver]):
    """Subscriptions of the processes that have been added and not removed."""

    def __init__(self) -> None:
        self._at: dict[Receiver, str] = {}
        """Place of each process."""
        self._rank: dict[Receiver, int] = {}
        self._starts = 0
        self._hear: dict[str, set[Receiver]] = {}
        """Receivers by expression, also where none is left."""
        self._wild: dict[str, list[str]] = {}
        """Expressions with a wildcard, by what `_ending` returns for them."""
        self._ways: dict[str, dict[str, _Way]] = {}
        """Ways of keys, by what `_ending` returns for them."""
        self._shared: dict[tuple[str, ...], list[tuple[Receiver, str]]] = {}
        """Receivers of the keys that the same expressions match."""
        self._shared_by: dict[str, list[tuple[str, ...]]] = {}
        """What is kept in `_shared` and changes with an expression."""
        self._known: dict[str, KeyReceivers[Receiver]] = {}
        self._known_by: dict[tuple[str, ...], list[str]] = {}
        """Keys whose receivers are known from what is kept in `_shared`."""

    def add(self, receiver: Receiver, name: str) -> None:
        """Add the process `name`, which subscribes to nothing yet."""
        self._starts += 1
        self._at[receiver], self._rank[receiver] = place_of(name), self._starts

    def change(self, receiver: Receiver, ended: Iterable[str], begun: Iterable[str]) -> None:
        """End and begin subscriptions of a process that has been added."""
        for expression in ended:
            self._hear[expression].discard(receiver)
            self._forget(expression)
        for expression in begun:
            if expression not in self._hear:
                self._learn(expression)
            self._hear[expression].add(receiver)
            self._forget(expression)

    def remove(self, receiver: Receiver, interests: Iterable[str]) -> None:
        """Remove a process with its subscriptions."""
        self.change(receiver, interests, ())
        del self._at[receiver], self._rank[receiver]

    def of(self, key: str) -> KeyReceivers[Receiver]:
        """Return who hears `key`."""
        known = self._known.get(key)
        if known is None:
            known = self._known[key] = self._found(key)
        return known

    def _found(self, key: str) -> KeyReceivers[Receiver]:
        ending = _ending(key)
        among = self._ways.setdefault(ending, {})
        way = among.get(key)
        if way is None:
            way = among[key] = _Way(*ends_of(key), self._matches(key, ending))
        receivers = self._shared.get(way.matching)
        if receivers is None:
            receivers = self._receivers(way.matching)
        self._known_by.setdefault(way.matching, []).append(key)
        if way.place is None:
            return KeyReceivers(way.sender, receivers)
        if way.place == way.sender:
            return KeyReceivers(None, receivers)
        return KeyReceivers(way.sender, [(each, way.place) for each, _ in receivers])

    def _matches(self, key: str, ending: str) -> tuple[str, ...]:
        """Return the expressions that match `key`."""
        wild = [
            expression
            for among in (ending, f"{ending.partition('/')[0]}/{ANY}", ANY)
            for expression in self._wild.get(among, ())
            if matches(expression, key)
        ]
        return (key, *wild) if key in self._hear else tuple(wild)

    def _receivers(self, matching: tuple[str, ...]) -> list[tuple[Receiver, str]]:
        """Return who subscribes to one of the expressions, and keep it until that changes."""
        hear = set[Receiver]().union(*(self._hear[expression] for expression in matching))
        found = [(each, self._at[each]) for each in sorted(hear, key=self._rank.__getitem__)]
        self._shared[matching] = found
        for expression in matching:
            self._shared_by.setdefault(expression, []).append(matching)
        return found

    def _learn(self, expression: str) -> None:
        """Take in an expression that nobody has subscribed to before: keys may match it."""
        self._hear[expression] = set()
        ending = _ending(expression)
        if "*" not in expression:
            self._ways.get(ending, {}).pop(expression, None)
            self._known.pop(expression, None)
            return
        self._wild.setdefault(ending, []).append(expression)
        endings = list(self._ways) if ANY in ending else [ending]
        for among in endings:
            for key in self._ways.pop(among, ()):
                self._known.pop(key, None)

    def _forget(self, expression: str) -> None:
        """Forget the receivers that follow from who subscribes to the expression."""
        for matching in self._shared_by.pop(expression, ()):
            self._shared.pop(matching, None)
            for key in self._known_by.pop(matching, ()):
                self._known.pop(key, None)


def _ending(expression: str) -> str:
    """Return what follows the owner in a key or expression: its topic, and the receiver or that it is a wildcard."""
    topic, *rest = expression.split("/")[3:] or [ANY]
    if "*" in topic:
        return ANY
    return "/".join((topic, ANY if any("*" in part for part in rest) else "/".join(rest)))
