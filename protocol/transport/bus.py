"""The bus interface of a transport, and the inbox between the transport's threads and the node's loop.

A transport's callbacks only call `Inbox.put`, on any thread; only the loop reads.
"""

from __future__ import annotations

import threading
from collections import deque
from typing import Protocol

from msgspec import Struct, structs

from lfa.protocol.node import PeerDown, PeerUp, RouterLost
from lfa.protocol.topics import TO_ALL, TO_HELLO, TOPIC, Address, address

INBOX_SIZE_MAX = 4096  # about 5 s of all messages of a fleet of 16 to one process
TOKEN_HOLD_S = 0.001
"""Time [s] that a vanished token is held: six times the measured delay from it to the report of a router's death."""
OWNER_RATE_MAX_HZ = 500.0
"""Maximum event rate [Hz] accepted per key owner: over twice the peak rate of a leader with seven voters."""
OWNER_BURST_MAX = 1000.0
"""Maximum number of events accepted at once from one owner, after a link or a process stalled."""
OWNERS_MAX = 256
TOKENS_MAX = 16
"""Maximum number of liveliness tokens of one owner at a time. It has one; those of incarnations that died with their
machine remain until a link times out."""
TOKEN_OWNERS_MAX = 1024
"""Maximum number of owners of tokens; a team of 100 robots has some 300."""
TOLD_MAX = 3
"""Number of owners that `Inbox.refused` names."""


class Arrival(Struct, frozen=True, gc=False):
    """Bytes on a key, or a local event, with the local time of arrival [s]."""

    at: float
    key: str
    payload: bytes | PeerUp | PeerDown | RouterLost


class Bus(Protocol):
    """Interface of a transport. All methods are called from the loop's thread only."""

    def publish(self, key: str, payload: bytes) -> None:
        """Send `payload` on `key`. Never blocks, never raises for a lost link."""

    def follow(self, interests: frozenset[str]) -> None:
        """Subscribe to exactly these key expressions from now on."""

    def close(self) -> None:
        """Close the session; peers see the token vanish at once."""


class Settable(Protocol):
    def set(self) -> None:
        """Signal an urgent arrival. Called on any thread."""


class Wake:
    """Wake-up of the loop, set by any thread and by signal handlers: a lock that is free when set.

    `threading.Event` is unsuitable: its lock is not re-entrant, so a signal that arrives while the loop holds the lock
    would deadlock the process in its own handler.
    """

    def __init__(self) -> None:
        self._unset = threading.Lock()
        self._unset.acquire()

    def set(self) -> None:
        try:
            self._unset.release()
        except RuntimeError:
            return  # already set

    def wait(self, timeout_s: float) -> bool:
        """Wait until set (return True) or for `timeout_s` >= 0 (return False); unset it."""
        return self._unset.acquire(timeout=timeout_s)


class Inbox:
    """Newest value per key of state topics, a bounded queue for all other messages, and one wake-up."""

    def __init__(
        self,
        wake: Settable | None = None,
        size_max: int = INBOX_SIZE_MAX,
        *,
        every: bool = False,
        defer_hellos: bool = False,
        eager: frozenset[str] = frozenset(),
    ) -> None:
        """`wake` is set on an urgent arrival; several inboxes of one loop share it.

        `every` queues state topics too, for a recorder that needs all values. `defer_hellos` keeps a process that reads
        its inbox fifty times a second anyway from being woken by HELLO, which processes without a vote repeat. `eager`
        names further topics that wake: a bridge passes sensors on without delay.
        """
        self._queue: deque[Arrival] = deque()
        self._newest: dict[str, Arrival] = {}
        self._size_max = size_max
        self._every = every
        self._defer_hellos = defer_hellos
        self._eager = eager
        self.defer_grants = False
        """Do not wake for answers to this process alone: set while its lease lasts well beyond its next deadline."""
        self.defer_rounds = False
        """Do not wake for what is said on `lease` to all: set while the process has no vote in it."""
        self._lock = threading.Lock()
        self._allowances: dict[str, tuple[float, float]] = {}
        """Remaining number of events that an owner may queue, and the time [s] of that number."""
        self._tokens = TokenCaps()
        self._refused: dict[str, int] = {}
        """Number of arrivals that were dropped for the rate or the number of tokens of their owner."""
        self._wake = wake or Wake()
        self.dropped = 0

    @property
    def refused(self) -> tuple[tuple[str, int], ...]:
        """The owners of which most was dropped for their rates or numbers of tokens, with the numbers since the start,
        the greatest first.
        """
        with self._lock:
            most = sorted(self._refused.items(), key=lambda item: (-item[1], item[0]))
        return tuple(most[:TOLD_MAX])

    def put(self, arrival: Arrival) -> None:
        """Add an arrival, on any thread; drop and count it if the queue is full or its owner exceeds its caps."""
        where = address(arrival.key)
        topic = TOPIC.get(where.topic) if where is not None else None
        with self._lock:
            if topic is not None and topic.state and not self._every:
                self._newest[arrival.key] = arrival
            elif len(self._queue) >= self._size_max or not self._admits(arrival, where):
                self.dropped += 1
                return
            else:
                self._queue.append(arrival)
        if where is None or topic is None or topic.name in self._eager or (topic.wakes and not self._can_wait(where)):
            self._wake.set()

    def drop(self) -> None:
        """Count an arrival that the transport could not read, on any thread."""
        with self._lock:
            self.dropped += 1

    def _can_wait(self, where: Address) -> bool:
        if where.topic != "lease":
            return False
        if where.to == TO_HELLO:
            return self._defer_hellos
        return self.defer_rounds if where.to == TO_ALL else self.defer_grants

    def _admits(self, arrival: Arrival, where: Address | None) -> bool:
        """Return whether the caps of its owner admit an arrival; count it otherwise."""
        token = arrival.payload if isinstance(arrival.payload, (PeerUp, PeerDown)) else None
        admits = token is None or self._tokens.admits(token)  # first: which tokens are there must stay known
        admits = admits and (self._every or self._allows(where, arrival.at))
        if not admits and where is not None and (where.owner in self._refused or len(self._refused) < OWNERS_MAX):
            self._refused[where.owner] = self._refused.get(where.owner, 0) + 1
        return admits

    def _allows(self, where: Address | None, now: float) -> bool:
        """Apply one token bucket per owner, so that a flooding owner takes neither time nor space from the others."""
        if where is None:
            return True  # loss of the own link
        owner = where.owner
        if owner not in self._allowances and len(self._allowances) >= OWNERS_MAX:
            self._allowances.clear()
        left, since = self._allowances.get(owner, (OWNER_BURST_MAX, now))
        left = min(left + OWNER_RATE_MAX_HZ * max(now - since, 0.0), OWNER_BURST_MAX)
        self._allowances[owner] = max(left - 1.0, 0.0), max(now, since)
        return left >= 1.0

    def take(self) -> list[Arrival]:
        """Return and remove all arrivals since the last call, oldest first."""
        with self._lock:
            if not self._queue and not self._newest:
                return []
            arrivals = [*self._queue, *self._newest.values()]
            self._queue.clear()
            self._newest.clear()
        arrivals.sort(key=_at)
        return arrivals


class TokenCaps:
    """Tokens that are there, up to a number of each owner: access rules name the keys of tokens and no numbers."""

    def __init__(self) -> None:
        self._there: dict[str, set[int]] = {}

    def admits(self, event: PeerUp | PeerDown) -> bool:
        """Return False for a token beyond the caps, when it appears and when it vanishes."""
        owner, number = event.name, event.incarnation
        there = self._there.get(owner)
        if isinstance(event, PeerDown):
            if there is None or number not in there:
                return there is None or len(there) < TOKENS_MAX
            there.discard(number)
            if not there:
                del self._there[owner]
            return True
        if there is None and len(self._there) < TOKEN_OWNERS_MAX:
            there = self._there[owner] = set()
        if there is None or (number not in there and len(there) >= TOKENS_MAX):
            return False
        there.add(number)
        return True


class Tokens:
    """Filter of liveliness events that removes those caused by the own router's death (zenoh.md 0.7).

    When the link to the router breaks, every token vanishes shortly *before* the report of the break, while
    `session.info` still shows the link. So a vanished token is held for TOKEN_HOLD_S and passed on only if no such
    report follows. Tokens that vanish while the link is gone are ignored too.
    """

    def __init__(self) -> None:
        self._held: list[Arrival] = []
        self._cut_off = False

    def debounce(self, arrivals: list[Arrival], now: float) -> list[Arrival]:
        """Return those of `arrivals` and of the held events that are valid at `now` [s]; hold new vanished tokens."""
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


def _at(arrival: Arrival) -> float:
    return arrival.at
