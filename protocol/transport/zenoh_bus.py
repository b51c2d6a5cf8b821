"""Zenoh behind the three methods of `Bus`, and the router: the only import of `zenoh` (zenoh.md section 0).

Every process is a client of its machine's router, over a unix socket or loopback; no multicast, no gossip. Callbacks
run on Zenoh's receiver threads and do nothing but append to the inbox.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from threading import get_ident
from typing import Any

import zenoh

from lfa.protocol import clock
from lfa.protocol.names import whole_number
from lfa.protocol.node import PeerDown, PeerUp, RouterLost
from lfa.protocol.topics import NO_ECHO, TOPIC, Topic, address, alive_key
from lfa.protocol.transport.bus import Arrival, Inbox
from lfa.protocol.transport.credentials import Credentials
from lfa.protocol.transport.endpoints import check_endpoints
from lfa.protocol.transport.zenoh_config import FOLLOWED_AT_ONCE, LINK_LEASE_MS, RouterAbsent, client_session, reason_of

_PRIORITY = {
    "real_time": zenoh.Priority.REAL_TIME,
    "prompt": zenoh.Priority.INTERACTIVE_HIGH,
    "data": zenoh.Priority.DATA,
    "background": zenoh.Priority.BACKGROUND,
}


class ZenohBus:
    """A client session with declared publishers, followed subscriptions and one liveliness token."""

    def __init__(
        self, endpoint: str, inbox: Inbox, lease_ms: int = LINK_LEASE_MS, credentials: Credentials | None = None
    ) -> None:
        """`endpoint` may be several, `a,b`: the first that answers, the next when that one is lost.

        `credentials` are shown to routers that ask for some, and tell whose routers are trusted. Raises RouterAbsent
        when no router answers or none lets us in, Refused for an endpoint that is none.
        """
        check_endpoints(endpoint, "connect")
        self._inbox = inbox
        try:
            self._session = client_session(endpoint, lease_ms, credentials)
        except zenoh.ZError as error:
            raise RouterAbsent(reason_of(error)) from None
        self._publishers: dict[str, zenoh.Publisher] = {}
        self._followed: dict[str, Any] = {}
        self._token: zenoh.LivelinessToken | None = None
        self._links = self._session.info.declare_transport_events_listener(
            zenoh.handlers.Callback(self._on_transport, indirect=False), history=False
        )

    def announce(self, fleet: str, owner: str, incarnation: int) -> None:
        """Declare the liveliness token that tells the others of this process's life."""
        self._token = self._session.liveliness().declare_token(alive_key(fleet, owner, incarnation))

    def living(self, fleet: str, owner: str, timeout_s: float = 1.0) -> list[int]:
        """Incarnations of `owner` whose tokens stand at the moment."""
        replies = self._session.liveliness().get(alive_key(fleet, owner, "*"), timeout=timeout_s)
        keys = [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]
        return sorted(peer.incarnation for key in keys if (peer := _peer(key, PeerUp)) is not None)

    def publish(self, key: str, payload: bytes) -> None:
        publisher = self._publishers.get(key)
        if publisher is None:
            publisher = self._publishers[key] = self._declare(key)
        publisher.put(payload)

    def follow(self, interests: frozenset[str]) -> None:
        for key in sorted(self._followed.keys() - interests):
            self._followed.pop(key).undeclare()
        for key in sorted(interests - self._followed.keys()):
            self._followed[key] = self._subscribe(key)

    def resubscribe(self) -> None:
        """Say once more to the router what is followed: declarations that cross a link while it comes back are
        dropped for good by a router that is busy (zenoh#1886), and all that they ask for with them."""
        for key in sorted(self._followed):
            self._followed[key].undeclare()
            self._followed[key] = self._subscribe(key)

    def close(self) -> None:
        """Undeclare all and leave: without it a callback subscriber would keep the interpreter alive."""
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
        parts = key.split("/")
        if len(parts) == 5 and parts[3] == "alive":
            callback = zenoh.handlers.Callback(self._on_token, indirect=False)
            return self._session.liveliness().declare_subscriber(key, callback, history=True)
        return self._session.declare_subscriber(key, zenoh.handlers.Callback(self._on_sample(key), indirect=False))

    def _on_sample(self, expression: str) -> Callable[[zenoh.Sample], None]:
        """What to do with a sample on `expression`, which is its key when it is no pattern."""
        put = self._inbox.put
        known = None if "*" in expression else expression

        def on_sample(sample: zenoh.Sample) -> None:
            if get_ident() not in _attached:
                _attach()
            put(Arrival(clock.now(), known or str(sample.key_expr), sample.payload.to_bytes()))

        return on_sample

    def _on_token(self, sample: zenoh.Sample) -> None:
        key = str(sample.key_expr)
        peer = _peer(key, PeerUp if sample.kind == zenoh.SampleKind.PUT else PeerDown)
        if peer is not None:
            self._inbox.put(Arrival(clock.now(), key, peer))

    def _on_transport(self, event: Any) -> None:
        if event.kind == zenoh.SampleKind.DELETE:
            self._inbox.put(Arrival(clock.now(), "", RouterLost()))


_attached: set[int] = set()


def _attach() -> None:
    """Let Python keep what it knows of the calling receiver thread, which lives as long as the process.

    Otherwise it makes that anew for each sample, with memory for its stack that the kernel maps and takes back: a
    fifteenth of an agent's processor time.
    """
    _attached.add(get_ident())
    ctypes.pythonapi.PyGILState_Ensure()


def _peer(key: str, kind: type[PeerUp] | type[PeerDown]) -> PeerUp | PeerDown | None:
    where = address(key)
    if where is None or where.topic != "alive" or where.to is None:
        return None
    incarnation = whole_number(where.to)
    return None if incarnation is None else kind(where.owner, incarnation)
