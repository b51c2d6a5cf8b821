"""The three methods that a transport has, and the inbox between its threads and the loop that thinks.

A transport's callbacks only call `Inbox.put`, on whatever thread they come; the loop alone reads.
"""

from __future__ import annotations

import threading
from collections import deque
from typing import Protocol

from msgspec import Struct

from protocol.node import PeerDown, PeerUp, RouterLost
from protocol.topics import TOPIC, address

INBOX_SIZE_MAX = 4096  # about 5 s of all that a fleet of 16 sends to one process


class Arrival(Struct, frozen=True, gc=False):
    """Bytes on a key, or a liveliness change, with the local time at which they came."""

    at: float
    key: str
    payload: bytes | PeerUp | PeerDown | RouterLost


class Bus(Protocol):
    """Where bytes go. All of it is called from the loop's thread only."""

    def publish(self, key: str, payload: bytes) -> None:
        """Send `payload`; never blocks, never raises for a lost link."""

    def follow(self, interests: frozenset[str]) -> None:
        """Hear exactly these key expressions from now on."""

    def close(self) -> None:
        """Leave; peers see the token go at once."""


class Inbox:
    """Newest value for state topics, a bounded queue for everything else, one wake-up."""

    def __init__(
        self, wake: threading.Event | None = None, size_max: int = INBOX_SIZE_MAX, *, every: bool = False
    ) -> None:
        """`wake` is set when something urgent came; several inboxes of one loop share it.

        `every` queues state topics too: a recorder wants all values, not the newest.
        """
        self._queue: deque[Arrival] = deque()
        self._newest: dict[str, Arrival] = {}
        self._size_max = size_max
        self._every = every
        self._lock = threading.Lock()
        self._wake = wake or threading.Event()
        self.dropped = 0

    def put(self, arrival: Arrival) -> None:
        """Called from foreign threads. A full queue drops the newcomer and counts it."""
        where = address(arrival.key)
        topic = TOPIC.get(where.topic) if where is not None else None
        with self._lock:
            if topic is not None and topic.state and not self._every:
                self._newest[arrival.key] = arrival
            elif len(self._queue) < self._size_max:
                self._queue.append(arrival)
            else:
                self.dropped += 1
        if topic is None or topic.wakes:
            self._wake.set()

    def take(self) -> list[Arrival]:
        """All that has come since the last call, oldest first."""
        with self._lock:
            if not self._queue and not self._newest:
                return []
            arrivals = [*self._queue, *self._newest.values()]
            self._queue.clear()
            self._newest.clear()
        arrivals.sort(key=_at)
        return arrivals


def _at(arrival: Arrival) -> float:
    return arrival.at
