"""Zenoh session on the side of ROS 2: a client of a ROS router, or that router itself.

It moves bytes between keys and knows neither types nor names of ROS. Callbacks run on Zenoh's receiver threads and may
only append to a queue. A session of its own beside the fleet's: no ROS node joins the fleet's router, and no key of the
fleet leaves it. Settings as in rmw_zenoh's own configuration files: timestamps, gossip at a router, long link lease.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import zenoh
import zenoh.ext
from zenoh import handlers

from lfa.protocol.errors import Refused
from lfa.protocol.transport.endpoints import check_endpoints
from lfa.protocol.transport.zenoh_config import (
    RouterAbsent,
    insert_settings,
    open_session,
    reason_of,
    session_config,
)
from lfa.protocol.transport.zenoh_router import ROUTER_RX_THREADS

ROS_LEASE_MS = 60_000
"""Silence [ms] after which a link of the ROS side counts as dead, as in rmw_zenoh."""
ROS_THREADS = 4
QUERY_S = 600.0
"""Time [s] that a service may take to answer, as in rmw_zenoh."""
HEARTBEAT_S = 0.5
"""Period [s] at which a publisher of latched topics repeats its last number, while it changes."""
PORT_LINE = "another router or bridge holds the port, stop it, or connect to it without --serve"

OnSample = Callable[[str, bytes, bytes], None]
"""Receives key, payload and attachment (empty without one)."""


class RosPublication(Protocol):
    """One declared publication."""

    def put(self, payload: bytes, attachment: bytes) -> None:
        """Publish; never blocks."""

    def matched(self) -> bool:
        """Return True if someone subscribes, or if that cannot be known."""

    def undeclare(self) -> None: ...


class Undeclarable(Protocol):
    def undeclare(self) -> None: ...


class RosQuery:
    """Query of a client, to be answered once."""

    def __init__(self, query: zenoh.Query) -> None:
        self._query = query
        self.key = str(query.key_expr)
        self.payload = b"" if query.payload is None else query.payload.to_bytes()
        self.attachment = b"" if query.attachment is None else query.attachment.to_bytes()

    def reply(self, payload: bytes, attachment: bytes) -> None:
        """Answer, and end the query: a client that waits for all answers waits until each query has ended."""
        try:
            self._query.reply(self.key, payload, attachment=attachment)
        except zenoh.ZError:
            return  # the client, or the link to it, is gone
        finally:
            self._query.drop()  # type: ignore[no-untyped-call]


class RosSession:
    """Session on the ROS side."""

    def __init__(self, connect: str, *, serve: bool = False) -> None:
        """Connect to the router at `connect`; with `serve`, listen there as the router of all ROS nodes.

        Raises RouterAbsent if no router answers, Refused if it cannot listen or for an invalid endpoint.
        """
        check_endpoints(connect, "--listen" if serve else "--ros")
        endpoints = connect.split(",")
        mode, listen = ("router", endpoints) if serve else ("client", [])
        config = session_config(mode, listen, [] if serve else endpoints, ROS_LEASE_MS, None)
        settings: dict[str, object] = {
            "timestamping/enabled": True,
            "queries_default_timeout": round(1000 * QUERY_S),
        }
        if serve:
            settings["scouting/gossip/enabled"] = True
        insert_settings(config, settings)
        try:
            self._session = open_session(config, ROUTER_RX_THREADS if serve else ROS_THREADS)
        except zenoh.ZError as error:
            if serve:
                raise Refused(f"listen {connect}: {PORT_LINE} ({reason_of(error)})") from None
            raise RouterAbsent(reason_of(error)) from None

    @property
    def id(self) -> str:
        """Id of the session as tokens write it."""
        return str(self._session.info.zid())

    def links(self) -> int:
        """Return the number of routers and peers that this session is linked to at the moment."""
        return len(self._session.info.routers_zid()) + len(self._session.info.peers_zid())

    def on_links(self, changed: Callable[[], None]) -> Undeclarable:
        """Call `changed` whenever a link appears or disappears."""

        def on_event(_event: object) -> None:
            changed()

        callback = handlers.Callback(on_event, indirect=False)
        return self._session.info.declare_transport_events_listener(callback, history=False)

    def token(self, key: str) -> Undeclarable:
        """Declare a liveliness token."""
        return self._session.liveliness().declare_token(key)

    def tokens(self, expression: str, on_token: Callable[[str, bool], None]) -> Undeclarable:
        """Call `on_token(key, appeared)` for all present tokens and for each change."""

        def on_sample(sample: zenoh.Sample) -> None:
            on_token(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        callback = handlers.Callback(on_sample, indirect=False)
        return self._session.liveliness().declare_subscriber(expression, callback, history=True)

    def tokens_now(self, expression: str, timeout_s: float) -> list[str]:
        """Return the tokens that exist at the moment."""
        replies = self._session.liveliness().get(expression, timeout=timeout_s)
        return [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]

    def publisher(self, key: str, *, reliable: bool, kept: int | None) -> RosPublication:
        """Declare a publisher; the last `kept` samples go to those who subscribe later (None: none are kept)."""
        reliability = zenoh.Reliability.RELIABLE if reliable else zenoh.Reliability.BEST_EFFORT
        if kept is None:
            plain = self._session.declare_publisher(
                key, congestion_control=zenoh.CongestionControl.DROP, reliability=reliability
            )
            return _Volatile(plain)
        return _Latched(
            zenoh.ext.declare_advanced_publisher(
                self._session,
                key,
                congestion_control=zenoh.CongestionControl.DROP,
                reliability=reliability,
                cache=zenoh.ext.CacheConfig(max_samples=kept),
                publisher_detection=True,
                sample_miss_detection=zenoh.ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=HEARTBEAT_S),
            )
        )

    def subscriber(self, key: str, on_sample: OnSample, *, kept: int | None) -> Undeclarable:
        """Subscribe; with `kept`, also ask each publisher for its last `kept` samples."""

        def receive(sample: zenoh.Sample) -> None:
            attached = b"" if sample.attachment is None else sample.attachment.to_bytes()
            on_sample(str(sample.key_expr), sample.payload.to_bytes(), attached)

        callback = handlers.Callback(receive, indirect=False)
        if kept is None:
            return self._session.declare_subscriber(key, callback)
        return zenoh.ext.declare_advanced_subscriber(
            self._session,
            key,
            callback,
            history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=kept),
            recovery=zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True),
            subscriber_detection=True,
        )

    def service(self, key: str, on_query: Callable[[RosQuery], None]) -> Undeclarable:
        """Declare a service; each query must be answered."""

        def receive(query: zenoh.Query) -> None:
            on_query(RosQuery(query))

        return self._session.declare_queryable(key, handlers.Callback(receive, indirect=False), complete=True)

    def call(self, key: str, payload: bytes, attachment: bytes, timeout_s: float) -> bytes | None:
        """Ask a service; return the payload of its answer, None if none comes in time."""
        replies = self._session.get(
            key,
            payload=payload,
            attachment=attachment,
            target=zenoh.QueryTarget.ALL_COMPLETE,
            consolidation=zenoh.ConsolidationMode.NONE,
            timeout=timeout_s,
        )
        return next((reply.ok.payload.to_bytes() for reply in replies if reply.ok is not None), None)

    def close(self) -> None:
        """Close the session with all its declarations."""
        self._session.close()  # type: ignore[no-untyped-call]


class _Volatile:
    """Publisher that is told of the first and the last subscriber: asking at each message costs more."""

    def __init__(self, publisher: zenoh.Publisher) -> None:
        self._publisher = publisher
        self._matched = False
        self._listener = publisher.declare_matching_listener(handlers.Callback(self._match, indirect=False))
        if publisher.matching_status.matching:  # type: ignore[attr-defined]  # no bool, as its stub says
            self._matched = True

    def put(self, payload: bytes, attachment: bytes) -> None:
        self._publisher.put(payload, attachment=attachment)

    def matched(self) -> bool:
        return self._matched

    def undeclare(self) -> None:
        self._listener.undeclare()  # type: ignore[no-untyped-call]
        self._publisher.undeclare()  # type: ignore[no-untyped-call]

    def _match(self, status: zenoh.MatchingStatus) -> None:
        self._matched = bool(status.matching)


class _Latched:
    """Publisher that keeps its last samples: it must also publish to nobody, and does not know who listens."""

    def __init__(self, publisher: zenoh.ext.AdvancedPublisher) -> None:
        self._publisher = publisher

    def put(self, payload: bytes, attachment: bytes) -> None:
        self._publisher.put(payload, attachment=attachment)

    def matched(self) -> bool:
        return True

    def undeclare(self) -> None:
        self._publisher.undeclare()  # type: ignore[no-untyped-call]


def ros_session(endpoint: str, serve: bool) -> RosSession:
    """Return a session on the ROS side. Raises Refused in one line when it cannot be opened."""
    try:
        return RosSession(endpoint, serve=serve)
    except RouterAbsent:
        raise Refused(
            f"--ros {endpoint}: no ROS router answers: start one (ros2 run rmw_zenoh_cpp rmw_zenohd), or give --serve"
        ) from None
