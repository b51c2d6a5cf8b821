"""The `Bus` interface implemented with a Zenoh client session (zenoh.md section 0).

Every process is a client of its machine's router, over a unix socket or loopback; no multicast, no gossip. Callbacks
run on Zenoh's receiver threads and only append to the inbox.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from random import SystemRandom
from threading import get_ident
from typing import Any

import zenoh

from lfa.protocol import clock
from lfa.protocol.incarnations import NUMBERS
from lfa.protocol.names import whole_number
from lfa.protocol.node import PeerDown, PeerUp, RouterLost
from lfa.protocol.topics import NO_ECHO, TOPIC, Topic, address, alive_key
from lfa.protocol.transport.bus import Arrival, Inbox
from lfa.protocol.transport.credentials import Credentials
from lfa.protocol.transport.endpoints import check_endpoints
from lfa.protocol.transport.spelling import respelled
from lfa.protocol.transport.zenoh_config import FOLLOWED_AT_ONCE, LINK_LEASE_MS, RouterAbsent, client_session, reason_of

_PRIORITY = {
    "real_time": zenoh.Priority.REAL_TIME,
    "prompt": zenoh.Priority.INTERACTIVE_HIGH,
    "data": zenoh.Priority.DATA,
    "background": zenoh.Priority.BACKGROUND,
}


LIVING_TRIES = 10
"""Number of times that a router is asked which tokens exist."""
PULLED_MAX = 1024
"""Number of samples of one subscription that wait for `pull`: 0.1 s of 200 robots. The oldest are dropped."""


class ZenohBus:
    """Zenoh client session with declared publishers, subscriptions and one liveliness token."""

    def __init__(
        self, endpoint: str, inbox: Inbox, lease_ms: int = LINK_LEASE_MS, credentials: Credentials | None = None
    ) -> None:
        """Open the session. `endpoint` may be several, `a,b`: the first that answers, the next if that one is lost.

        `credentials` are shown to routers that ask for them, and define the trusted routers. Raises RouterAbsent if no
        router answers or accepts the session, Refused for an invalid endpoint.
        """
        check_endpoints(endpoint, "connect")
        self._inbox = inbox
        try:
            self._session = client_session(endpoint, lease_ms, credentials)
        except zenoh.ZError as error:
            raise RouterAbsent(reason_of(error)) from None
        self._publishers: dict[str, zenoh.Publisher] = {}
        self._followed: dict[str, Any] = {}
        self._pulled: frozenset[str] = frozenset()
        self._spelled: dict[str, str] = {}
        """Spelling under which each followed key expression is declared at the moment; only its samples count."""
        self._name, self._turn = f"{SystemRandom().getrandbits(32):08x}", 0
        """Whose spellings are used (an observer has none of its own), and how often all were declared again."""
        self._token: zenoh.LivelinessToken | None = None
        self._links = self._session.info.declare_transport_events_listener(
            zenoh.handlers.Callback(self._on_transport, indirect=False), history=False
        )

    def announce(self, fleet: str, owner: str, incarnation: int) -> None:
        """Declare the liveliness token of this incarnation."""
        self._name = owner
        self._token = self._session.liveliness().declare_token(alive_key(fleet, owner, incarnation))

    def withdraw(self) -> None:
        """Undeclare the token of this incarnation, whose end others see at once."""
        if self._token is not None:
            self._token.undeclare()  # type: ignore[no-untyped-call]
            self._token = None

    def living(self, fleet: str, owner: str, timeout_s: float = 1.0) -> list[int]:
        """Return the incarnations of `owner` whose tokens exist at the moment.

        A router that is too busy to answer within `timeout_s` is asked again, `LIVING_TRIES` times in all: that nothing
        is heard of a token does not mean that there is none, and who joins on that ground takes it for a twin's later.
        """
        for _ in range(LIVING_TRIES):
            replies = list(self._session.liveliness().get(alive_key(fleet, owner, "*"), timeout=timeout_s))
            if all(reply.err is None for reply in replies):
                break
        keys = [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]
        return sorted(peer.incarnation for key in keys if (peer := _peer(key, PeerUp)) is not None)

    def publish(self, key: str, payload: bytes) -> None:
        publisher = self._publishers.get(key)
        if publisher is None:
            publisher = self._publishers[key] = self._declare(key)
        publisher.put(payload)

    def follow(self, interests: frozenset[str], pulled: frozenset[str] = frozenset()) -> None:
        """Subscribe to exactly `interests` from now on. Samples of those in `pulled` wait for `pull`.

        A sample that waits costs a third less than one whose callback runs at once: it takes the interpreter's lock
        together with others.
        """
        self._pulled = pulled
        for key in sorted(self._followed.keys() - interests):
            self._followed.pop(key).undeclare()
        for key in sorted(interests - self._followed.keys()):
            self._spelled[key] = key
            self._followed[key] = self._subscribe(key)

    def pull(self, key: str) -> None:
        """Put the waiting samples of the pulled key expression `key` into the inbox, as arrivals of now.

        Of a state topic, the newest value of each key. Does nothing for a key expression that is not followed.
        """
        subscriber = self._followed.get(key)
        if subscriber is None:
            return
        now, newest = clock.now(), dict[str, zenoh.Sample]()
        while (sample := subscriber.try_recv()) is not None:
            name = str(sample.key_expr)
            where = address(name)
            if where is not None and TOPIC[where.topic].state:
                newest[name] = sample
            else:
                self._inbox.put(Arrival(now, name, sample.payload.to_bytes()))
        for name, sample in newest.items():
            self._inbox.put(Arrival(now, name, sample.payload.to_bytes()))

    def resubscribe(self) -> None:
        """Declare all subscriptions to the router again, each in another spelling where it has one.

        A busy router permanently drops declarations that cross a link while it recovers (zenoh#1886), and with them the
        subscribed messages. What another client of the own router has declared in the same words is not passed on.
        """
        self._turn += 1
        for key in sorted(self._followed):
            before = self._followed[key]
            spelling = key if _is_token(key) else respelled(key, self._name, self._turn)
            if spelling == self._spelled[key]:
                before.undeclare()
                self._followed[key] = self._subscribe(key)
                continue
            after = self._declared(key, spelling)
            self._spelled[key] = spelling  # from here on its samples count: none is lost between, none comes twice
            before.undeclare()
            self._followed[key] = after

    def close(self) -> None:
        """Close the session with all its declarations; otherwise a callback subscriber keeps the interpreter alive."""
        self._session.close()  # type: ignore[no-untyped-call]

    def _declare(self, key: str) -> zenoh.Publisher:
        where = address(key)
        topic: Topic = TOPIC[where.topic] if where is not None else TOPIC["event"]
        return self._session.declare_publisher(
            key,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=_PRIORITY[topic.priority],
            express=topic.priority == "real_time" and topic.name not in FOLLOWED_AT_ONCE,
            allowed_destination=zenoh.Locality.REMOTE if topic.name in NO_ECHO else zenoh.Locality.ANY,
        )

    def _subscribe(self, key: str) -> Any:
        if _is_token(key):
            callback = zenoh.handlers.Callback(self._on_token, indirect=False)
            return self._session.liveliness().declare_subscriber(key, callback, history=True)
        return self._declared(key, self._spelled[key])

    def _declared(self, key: str, spelling: str) -> Any:
        if key in self._pulled:
            return self._session.declare_subscriber(spelling, zenoh.handlers.RingChannel(PULLED_MAX))
        callback = zenoh.handlers.Callback(self._on_sample(key, spelling), indirect=False)
        return self._session.declare_subscriber(spelling, callback)

    def _on_sample(self, expression: str, spelling: str) -> Callable[[zenoh.Sample], None]:
        """Return the callback for samples on `spelling` of `expression`: the key itself if it has no wildcard."""
        put, spelled = self._inbox.put, self._spelled
        known = None if "*" in spelling else expression

        def on_sample(sample: zenoh.Sample) -> None:
            if get_ident() not in _attached:
                _attach()
            if spelled.get(expression) == spelling:
                put(Arrival(clock.now(), known or str(sample.key_expr), sample.payload.to_bytes()))

        return on_sample

    def _on_token(self, sample: zenoh.Sample) -> None:
        key = str(sample.key_expr)
        peer = _peer(key, PeerUp if sample.kind == zenoh.SampleKind.PUT else PeerDown)
        if peer is None:
            self._inbox.drop()
        else:
            self._inbox.put(Arrival(clock.now(), key, peer))

    def _on_transport(self, event: Any) -> None:
        if event.kind == zenoh.SampleKind.DELETE:
            self._inbox.put(Arrival(clock.now(), "", RouterLost()))


_attached: set[int] = set()


def _attach() -> None:
    """Make Python keep the thread state of the calling receiver thread, which exists until the process ends.

    Otherwise Python creates it again for each sample, with stack memory that the kernel maps and unmaps: a fifteenth of
    an agent's processor time.
    """
    _attached.add(get_ident())
    ctypes.pythonapi.PyGILState_Ensure()


def _is_token(key: str) -> bool:
    parts = key.split("/")
    return len(parts) == 5 and parts[3] == "alive"


def _peer(key: str, kind: type[PeerUp] | type[PeerDown]) -> PeerUp | PeerDown | None:
    where = address(key)
    if where is None or where.topic != "alive" or where.to is None:
        return None
    incarnation = whole_number(where.to)
    return None if incarnation is None or incarnation >= NUMBERS else kind(where.owner, incarnation)
