"""ROS nodes of this process: publishers, subscriptions, services and clients over one `RosSession`.

Zenoh's threads only fill bounded queues and set the wake-up; the loop decodes what `take` returns. Bytes that are no
message of the expected type are counted in `undecodable` and dropped.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from threading import Lock
from typing import Any, Generic, TypeVar

from msgspec import Struct

from lfa.deploy.ros.graph import TOKENS_MAX, RosGraph
from lfa.deploy.ros.types import BadRosMessage, from_cdr, request_type, response_type, to_cdr, type_hash
from lfa.deploy.ros.wire import (
    DEFAULT,
    TOKENS,
    Distro,
    Kind,
    Qos,
    RosEndpoint,
    RosNode,
    attachment,
    read_attachment,
)
from lfa.protocol import clock
from lfa.protocol.transport.bus import Settable
from lfa.protocol.transport.links import ANEW_S
from lfa.protocol.transport.zenoh_ros import RosPublication, RosQuery, RosSession, Undeclarable

T = TypeVar("T")
QUEUE_MAX = 64
"""Maximum number of samples or queries that wait for the loop; the oldest is dropped and counted."""


class Counters(Struct):
    """Traffic of all nodes of one session."""

    published: int = 0
    received: int = 0
    undecodable: int = 0
    dropped: int = 0


class RosSpace:
    """All nodes of one session in one ROS domain; nodes and endpoints share one counter of ids, as in rmw_zenoh."""

    def __init__(
        self,
        session: RosSession,
        domain: int,
        distro: Distro,
        wake: Settable,
        wall_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        """`wake` is set when something arrives; `wall_ns` returns the UNIX time [ns] for attachments."""
        self.session = session
        self.domain = domain
        self.distro = distro
        self.wake = wake
        self.wall_ns = wall_ns
        self.counters = Counters()
        self.open: set[NodeHandle] = set()
        """Nodes that are not closed; Zenoh undeclares what nothing refers to."""
        self._next_id = 0

    def take_id(self) -> int:
        self._next_id += 1
        return self._next_id - 1

    def node(self, name: str, namespace: str = "") -> NodeHandle:
        """Declare a node; it is listed until `close`."""
        return NodeHandle(self, RosNode(self.domain, self.session.id, self.take_id(), namespace, name))


class NodeHandle:
    """One declared node with its endpoints."""

    def __init__(self, space: RosSpace, node: RosNode) -> None:
        self.space = space
        self.node = node
        self._declared: list[Undeclarable] = [space.session.token(node.token)]
        space.open.add(self)

    def publisher(self, topic: str, of_type: str, qos: Qos = DEFAULT) -> RosPublisher:
        return RosPublisher(self, self._endpoint("MP", topic, of_type, qos))

    def subscription(self, topic: str, of_type: str, qos: Qos = DEFAULT) -> RosSubscription:
        return RosSubscription(self, self._endpoint("MS", topic, of_type, qos))

    def service(self, name: str, of_type: str) -> RosService:
        return RosService(self, self._endpoint("SS", name, of_type, DEFAULT))

    def client(self, name: str, of_type: str) -> RosClient:
        return RosClient(self, self._endpoint("SC", name, of_type, DEFAULT))

    def keep(self, declared: Undeclarable) -> None:
        """Undeclare `declared` together with the node."""
        self._declared.append(declared)

    def close(self) -> None:
        """Undeclare all endpoints and the node, the last declared first."""
        while self._declared:
            self._declared.pop().undeclare()
        self.space.open.discard(self)

    def _endpoint(self, kind: Kind, topic: str, of_type: str, qos: Qos) -> RosEndpoint:
        space = self.space
        return RosEndpoint(self.node, space.take_id(), kind, topic, of_type, type_hash(of_type, space.distro), qos)


class RosPublisher:
    """Publisher of one topic; its messages are numbered from 1."""

    def __init__(self, node: NodeHandle, endpoint: RosEndpoint) -> None:
        self._space = node.space
        self._gid = endpoint.gid
        self._number = 0
        qos = endpoint.qos
        kept = qos.depth if qos.latched else None
        self._publication: RosPublication = node.space.session.publisher(endpoint.key, reliable=qos.reliable, kept=kept)
        node.keep(self._publication)
        node.keep(node.space.session.token(endpoint.token))

    def heard(self) -> bool:
        """Return True if someone subscribes; always True for a latched topic, which also counts for later ones."""
        return self._publication.matched()

    def publish(self, message: Any) -> None:
        self._number += 1
        space = self._space
        space.counters.published += 1
        self._publication.put(to_cdr(message), attachment(self._number, space.wall_ns(), self._gid))


class RosSubscription:
    """Subscription to one topic; `take` returns what came since the last call."""

    def __init__(self, node: NodeHandle, endpoint: RosEndpoint) -> None:
        self._space = node.space
        self._type = endpoint.type
        self._queue: _Queue[tuple[float, bytes]] = _Queue(node.space)
        qos = endpoint.qos
        kept = qos.depth if qos.latched else None
        node.keep(node.space.session.subscriber(endpoint.key, self._receive, kept=kept))
        node.keep(node.space.session.token(endpoint.token))

    def take(self) -> list[Any]:
        """Return the messages received since the last call, oldest first."""
        return [message for _, message in self.take_timed()]

    def take_timed(self) -> list[tuple[float, Any]]:
        """Return the messages received since the last call with the times of their arrival [s], oldest first."""
        found = []
        for arrived, payload in self._queue.drain():
            try:
                found.append((arrived, from_cdr(payload, self._type)))
            except BadRosMessage:
                self._space.counters.undecodable += 1
        return found

    def _receive(self, _key: str, payload: bytes, _attached: bytes) -> None:
        self._queue.put((clock.now(), payload))


class ServiceCall(Struct, frozen=True):
    """One call of a service; `answer` sends the response."""

    request: Any
    answer: Callable[[Any], None]


class RosService:
    """Service; `take` returns the calls since the last time, each to be answered."""

    def __init__(self, node: NodeHandle, endpoint: RosEndpoint) -> None:
        self._space = node.space
        self._type = endpoint.type
        self._queue: _Queue[RosQuery] = _Queue(node.space)
        node.keep(node.space.session.service(endpoint.key, self._queue.put))
        node.keep(node.space.session.token(endpoint.token))

    def take(self) -> list[ServiceCall]:
        found = []
        for query in self._queue.drain():
            attached = read_attachment(query.attachment)
            try:
                request = from_cdr(query.payload, request_type(self._type))
            except BadRosMessage:
                attached = None
            if attached is None:  # without the caller's number and GID no answer could be built
                self._space.counters.undecodable += 1
                continue
            found.append(ServiceCall(request, self._answer(query, attached.number, attached.gid)))
        return found

    def _answer(self, query: RosQuery, number: int, gid: bytes) -> Callable[[Any], None]:
        def answer(response: Any) -> None:
            query.reply(to_cdr(response), attachment(number, self._space.wall_ns(), gid))

        return answer


class RosClient:
    """Client of one service."""

    def __init__(self, node: NodeHandle, endpoint: RosEndpoint) -> None:
        self._space = node.space
        self._endpoint = endpoint
        self._number = 0
        node.keep(node.space.session.token(endpoint.token))

    def call(self, request: Any, timeout_s: float) -> Any | None:
        """Call the service and wait for its response; None if none comes in time or it cannot be read."""
        self._number += 1
        space, endpoint = self._space, self._endpoint
        attached = attachment(self._number, space.wall_ns(), endpoint.gid)
        payload = space.session.call(endpoint.key, to_cdr(request), attached, timeout_s)
        if payload is None:
            return None
        try:
            return from_cdr(payload, response_type(endpoint.type))
        except BadRosMessage:
            space.counters.undecodable += 1
            return None


class GraphFeed:
    """The ROS graph of one domain or of all, fed by liveliness tokens; `poll` brings it up to date.

    When a link returns, the tokens are asked for again: a router that was restarted does not repeat them.
    """

    def __init__(self, space: RosSpace, *, all_domains: bool = False) -> None:
        self._space = space
        self._expression = f"{TOKENS}/{'*' if all_domains else space.domain}/**"
        self._graph = RosGraph()
        self._queue: deque[tuple[str, bool]] = deque(maxlen=TOKENS_MAX)
        self._links_changed = False
        self._again_at: list[float] = []
        self._links = space.session.on_links(self._on_links)
        self._tokens = self._subscribe()

    def poll(self, now: float) -> RosGraph:
        """Return the graph at `now` [s]."""
        if self._links_changed:
            self._links_changed, self._again_at = False, [now + after_s for after_s in ANEW_S]
        if self._again_at and now >= self._again_at[0]:
            self._again_at.pop(0)
            self._tokens.undeclare()
            self._tokens = self._subscribe()
        while self._queue:
            token, up = self._queue.popleft()
            self._graph.update(token, up=up)
        return self._graph

    def close(self) -> None:
        self._tokens.undeclare()
        self._links.undeclare()

    def _subscribe(self) -> Undeclarable:
        return self._space.session.tokens(self._expression, self._on_token)

    def _on_token(self, token: str, up: bool) -> None:
        self._queue.append((token, up))
        self._space.wake.set()

    def _on_links(self) -> None:
        self._links_changed = True


class _Queue(Generic[T]):
    """Bounded queue from Zenoh's threads to the loop."""

    def __init__(self, space: RosSpace) -> None:
        self._space = space
        self._items: deque[T] = deque()
        self._lock = Lock()

    def put(self, item: T) -> None:
        """Add an item, on any thread; the oldest goes if the queue is full."""
        with self._lock:
            self._space.counters.received += 1
            if len(self._items) >= QUEUE_MAX:
                self._items.popleft()
                self._space.counters.dropped += 1
            self._items.append(item)
        self._space.wake.set()

    def drain(self) -> list[T]:
        if not self._items:  # nearly always, and fifty times a second for each service
            return []
        with self._lock:
            items = list(self._items)
            self._items.clear()
        return items
