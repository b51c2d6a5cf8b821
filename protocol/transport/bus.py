"""The three methods that a transport has, and the inbox between its threads and the loop that thinks.

A transport's callbacks only call `Inbox.put`, on whatever thread they come; the loop alone reads.
"""

from __future__ import annotations

import threading
from collections import deque
from typing import Protocol

from msgspec import Struct, structs

from lfa.protocol.messages.consensus import GRANT_MARK, HELLO_MARK
from lfa.protocol.node import Local, PeerDown, PeerUp, RouterLost
from lfa.protocol.topics import TOPIC, Address, Topic, address

INBOX_SIZE_MAX = 4096  # about 5 s of all that a fleet of 16 sends to one process
ANEW_S = (1.5, 6.5)
"""Routers have met again by then: links are tried every second, and a busy machine takes its time."""
TOKEN_HOLD_S = 0.001
"""How long a vanished token is held back: six times what was measured between it and the news of a router's death."""
OWNER_RATE_MAX_HZ = 500.0
"""Events that one owner of keys may have heard: over twice what a leader of seven voters says at its busiest."""
OWNER_BURST_MAX = 1000.0
"""So many may come at once, after a link or a process stood still."""
OWNERS_MAX = 256


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


class Settable(Protocol):
    def set(self) -> None:
        """Something urgent came. Called on any thread."""


class Wake:
    """The loop's one wake-up, set by any thread and by signal handlers: a lock that is free when it is set.

    `threading.Event` will not do: its lock is not re-entrant, and a signal that comes while the loop itself holds it
    stops the process for good, in its own handler.
    """

    def __init__(self) -> None:
        self._unset = threading.Lock()
        self._unset.acquire()

    def set(self) -> None:
        try:
            self._unset.release()
        except RuntimeError:
            return  # it is set already

    def wait(self, timeout_s: float) -> bool:
        """Until it is set (True) or `timeout_s`, 0 or more, have passed (False); afterwards it is unset."""
        return self._unset.acquire(timeout=timeout_s)


class Inbox:
    """Newest value for state topics, a bounded queue for everything else, one wake-up."""

    def __init__(
        self,
        wake: Settable | None = None,
        size_max: int = INBOX_SIZE_MAX,
        *,
        every: bool = False,
        defer_hellos: bool = False,
    ) -> None:
        """`wake` is set when something urgent came; several inboxes of one loop share it.

        `every` queues state topics too: a recorder wants all values, not the newest. `defer_hellos`: who looks in fifty
        times a second anyway is not woken by HELLO, which all without a vote keep saying.
        """
        self._queue: deque[Arrival] = deque()
        self._newest: dict[str, Arrival] = {}
        self._size_max = size_max
        self._every = every
        self._defer_hellos = defer_hellos
        self.defer_grants = False
        """GRANT can wait as well: of one that leads, and whose lease lasts well beyond its next look."""
        self._lock = threading.Lock()
        self._allowances: dict[str, tuple[float, float]] = {}
        """How many more events an owner may have queued, as of when."""
        self._wake = wake or Wake()
        self.dropped = 0

    def put(self, arrival: Arrival) -> None:
        """Called from foreign threads. A full queue drops the newcomer and counts it; so does a flood of one owner."""
        where = address(arrival.key)
        topic = TOPIC.get(where.topic) if where is not None else None
        with self._lock:
            if topic is not None and topic.state and not self._every:
                self._newest[arrival.key] = arrival
            elif len(self._queue) >= self._size_max or not (self._every or self._allows(where, arrival.at)):
                self.dropped += 1
                return
            else:
                self._queue.append(arrival)
        if topic is None or (topic.wakes and not self._can_wait(topic, arrival.payload)):
            self._wake.set()

    def _can_wait(self, topic: Topic, payload: object) -> bool:
        if topic.name != "lease" or not isinstance(payload, bytes):
            return False
        return (self._defer_hellos and HELLO_MARK in payload) or (self.defer_grants and GRANT_MARK in payload)

    def _allows(self, where: Address | None, now: float) -> bool:
        """A token bucket an owner: whoever floods is heard less, and takes neither time nor room from the others."""
        if where is None:
            return True  # the loss of our own link
        owner = where.owner
        if owner not in self._allowances and len(self._allowances) >= OWNERS_MAX:
            self._allowances.clear()
        left, since = self._allowances.get(owner, (OWNER_BURST_MAX, now))
        left = min(left + OWNER_RATE_MAX_HZ * max(now - since, 0.0), OWNER_BURST_MAX)
        self._allowances[owner] = max(left - 1.0, 0.0), max(now, since)
        return left >= 1.0

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


class Tokens:
    """Liveliness changes, without those that only tell of the own router's death (zenoh.md 0.7).

    When the link to the router breaks, every token vanishes, a moment *before* the news of the break; and
    `session.info` still shows the link then. So a token that vanished is held for a moment, and believed when no such
    news followed. Nor does anything that vanishes while the link is gone say anything.
    """

    def __init__(self) -> None:
        self._held: list[Arrival] = []
        self._cut_off = False

    def debounce(self, arrivals: list[Arrival], now: float) -> list[Arrival]:
        """Of `arrivals` and of what is held, what may be believed by `now`; a token that is held comes later."""
        if not arrivals and not self._held:
            return arrivals
        through: list[Arrival] = []
        for arrival in arrivals:
            match arrival.payload:
                case PeerDown():
                    if not self._cut_off:
                        self._held.append(structs.replace(arrival, at=arrival.at + TOKEN_HOLD_S))
                    continue
                case PeerUp(name, incarnation):
                    self._cut_off = False
                    self._held = [held for held in self._held if held.payload != PeerDown(name, incarnation)]
                case RouterLost():
                    self._cut_off = True
                    self._held.clear()
            through.append(arrival)
        if self._held:
            through += [held for held in self._held if held.at <= now]
            self._held = [held for held in self._held if held.at > now]
            through.sort(key=_at)
        return through

    def next_due(self) -> float:
        return min([held.at for held in self._held]) if self._held else float("inf")


class Links:
    """When to tell the router anew what is followed: a while after links between routers may have gone and come back.

    Declarations that cross a link while it comes back are dropped for good by a router that is busy (zenoh#1886), and
    with them all that they ask for. Tokens tell of links: one that vanishes, and one that comes back in the same life.
    """

    def __init__(self) -> None:
        self._due: list[float] = []
        self._gone: set[tuple[str, int]] = set()
        self._cut_off = False

    @property
    def anew_at(self) -> float:
        return self._due[0] if self._due else float("inf")

    def see(self, event: Local, now: float) -> None:
        match event:
            case PeerDown(name, incarnation):
                self._gone.add((name, incarnation))
            case PeerUp(name, incarnation) if self._cut_off or (name, incarnation) in self._gone:
                self._gone.discard((name, incarnation))
            case RouterLost():
                self._cut_off = True
                return
            case _:
                return
        self._due = [now + after_s for after_s in ANEW_S]

    def due(self, now: float) -> bool:
        """True once each time."""
        if now < self.anew_at:
            return False
        self._due.pop(0)
        self._cut_off = False
        return True


def _at(arrival: Arrival) -> float:
    return arrival.at
