"""Foxglove channels as output of the bridge: the same CDR with ros2msg schemas on a WebSocket server."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future
from concurrent.futures import TimeoutError as LateAnswer

import foxglove
from foxglove.websocket import Capability, ServerListener, Service, ServiceRequest

from lfa.deploy.ros.bridge.inward import HANDOVER_S_MAX, SET_BOOL, TRIGGER
from lfa.deploy.ros.mapping import RosMessage
from lfa.deploy.ros.session import ServiceCall
from lfa.deploy.ros.topics import RosTopic, fleet_topics, robot_topics
from lfa.deploy.ros.types import BadRosMessage, from_cdr, kind, request_type, to_cdr, typestore
from lfa.protocol.errors import Refused

ANSWER_S_MAX = HANDOVER_S_MAX + 2.0
PENDING_MAX = 16
SUBSCRIPTIONS_MAX = 10_000
_REQUESTS = {TRIGGER: "", SET_BOOL: "bool data"}
"""Definitions of the services' requests."""


class FoxgloveOutput:
    """Server with one channel per topic. Foxglove does not latch: latched messages are sent again to later clients."""

    def __init__(self, host: str, port: int, services: Mapping[str, str], *, tf_per_robot: bool) -> None:
        """Start the server with `services`, each with its type. Raises Refused if it cannot listen."""
        self._tf_per_robot = tf_per_robot
        self._context = foxglove.Context()
        self._channels: dict[str, foxglove.Channel] = {}
        self._latched: dict[str, bytes | None] = {}
        self._robots: dict[int, tuple[RosTopic, ...]] = {}
        self._newcomers: deque[str] = deque(maxlen=SUBSCRIPTIONS_MAX)
        self.calls: deque[tuple[str, ServiceCall]] = deque(maxlen=PENDING_MAX)
        """Calls of services that wait for the loop, by name."""
        self._declare(fleet_topics(tf_per_robot=tf_per_robot, sim_time=False))
        try:
            self._server = foxglove.start_server(
                name="lfa",
                host=host,
                port=port,
                capabilities=[Capability.Services],
                supported_encodings=["cdr"],
                services=[_service(name, of_type, self._call) for name, of_type in services.items()],
                server_listener=_Newcomers(self._newcomers),
                context=self._context,
            )
        except (OSError, RuntimeError) as error:
            raise Refused(f"--host {host} --port {port}: {error}: must be free, and of this machine") from None

    @property
    def port(self) -> int:
        return self._server.port

    @property
    def robots(self) -> frozenset[int]:
        return frozenset(self._robots)

    def heard(self, topic: str) -> bool:
        """Return True if someone listens to `topic`; always for a latched one."""
        channel = self._channels.get(topic)
        return channel is not None and (topic in self._latched or channel.has_sinks())

    def join(self, robot: int) -> None:
        self._robots[robot] = robot_topics(robot, tf_per_robot=self._tf_per_robot)
        self._declare(self._robots[robot])

    def leave(self, robot: int) -> None:
        for topic in self._robots.pop(robot):
            self._channels.pop(topic.name).close()
            self._latched.pop(topic.name, None)

    def publish(self, sent: Iterable[RosMessage]) -> None:
        for one in sent:
            channel = self._channels.get(one.topic)
            if channel is None:
                continue
            payload = to_cdr(one.message)
            if one.topic in self._latched:
                self._latched[one.topic] = payload
            channel.log(payload, log_time=one.stamp_ns)

    def greet(self, now_ns: int) -> None:
        """Send the latched messages again that someone has subscribed to since the last call."""
        topics = set()
        while self._newcomers:
            topics.add(self._newcomers.popleft())
        for topic in topics:
            payload = self._latched.get(topic)
            if payload is not None:
                self._channels[topic].log(payload, log_time=now_ns)

    def close(self) -> None:
        self._server.stop()

    def _declare(self, topics: Iterable[RosTopic]) -> None:
        for topic in topics:
            definition = typestore().generate_msgdef(topic.type, ros_version=2)[0].encode()
            schema = foxglove.Schema(name=topic.type, encoding="ros2msg", data=definition)
            self._channels[topic.name] = foxglove.Channel(
                topic.name, schema=schema, message_encoding="cdr", context=self._context
            )
            if topic.qos.latched:
                self._latched[topic.name] = None

    def _call(self, name: str, request: object) -> bytes:
        """Answer a call, on one of the server's threads: the loop decides."""
        answer: Future[bytes] = Future()
        if len(self.calls) >= PENDING_MAX:
            raise ValueError("too many calls at once")
        self.calls.append((name, ServiceCall(request, lambda response: answer.set_result(to_cdr(response)))))
        try:
            return answer.result(ANSWER_S_MAX)
        except LateAnswer:
            raise ValueError("no answer in time") from None


class _Newcomers(ServerListener):
    """Listener that notes on the server's threads which topics someone has subscribed to."""

    def __init__(self, topics: deque[str]) -> None:
        self._topics = topics

    def on_subscribe(self, _client: object, channel: foxglove.websocket.ChannelView) -> None:
        self._topics.append(channel.topic)


def _service(name: str, of_type: str, call: Callable[[str, object], bytes]) -> Service:
    request, response = (
        foxglove.MessageSchema(
            encoding="cdr",
            schema=foxglove.Schema(name=f"{of_type}_{part}", encoding="ros2msg", data=definition.encode()),
        )
        for part, definition in (("Request", _REQUESTS[of_type]), ("Response", "bool success\nstring message"))
    )

    def handle(request: ServiceRequest) -> bytes:
        return call(request.service_name, _request(of_type, request.payload))

    schema = foxglove.ServiceSchema(name=of_type, request=request, response=response)
    return Service(name=name, schema=schema, handler=handle)


def _request(of_type: str, payload: bytes) -> object:
    """Return the request in `payload`; one that says nothing may have any bytes. Raises ValueError for others."""
    if not _REQUESTS[of_type]:
        return kind(request_type(of_type))(0)
    try:
        return from_cdr(payload, request_type(of_type))
    except BadRosMessage as bad:
        raise ValueError(str(bad)) from None
