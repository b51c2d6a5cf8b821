"""Zenoh links of a lockstep run: grants from the run to each process, answers back.

The run is the router itself, so that a grant crosses one link. Nothing is dropped: either side waits for room.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from typing import Any

import msgspec
import zenoh

from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.messages.codec import encode
from lfa.protocol.messages.grants import GrantAnswer, TimeGrant
from lfa.protocol.node import Envelope
from lfa.protocol.topics import OPERATOR_NAME, key
from lfa.protocol.transport.zenoh_config import (
    CLIENT_THREADS,
    client_session,
    open_session,
    reason_of,
    session_config,
    socket_path,
)
from lfa.protocol.transport.zenoh_router import check_listen

LINK_LEASE_MS = 10_000
"""Silence [ms] after which a link counts as lost: the run decides by its own time-out when a process has ended."""
WAITING_MAX = 256
HELLO_S = 0.1
NUDGE_S = 0.2
"""Interval [s] in which a waiting run looks at its processes, and at what its user wants."""
_GRANT, _ANSWER, _NUDGE = "grant", "answer", "nudge"

_encode = msgspec.msgpack.Encoder().encode
_grants = msgspec.msgpack.Decoder(TimeGrant)
_answers = msgspec.msgpack.Decoder(GrantAnswer)


def _key(fleet: str, name: str, kind: str, incarnation: int | str) -> str:
    return f"lfa/{fleet}/{name}/{kind}/{incarnation}"


class GrantLink:
    """Link of one granted process to its run. Raises Refused if no run is at `endpoint`."""

    def __init__(self, endpoint: str, fleet: str, name: str, incarnation: int) -> None:
        try:
            self._session = client_session(endpoint, LINK_LEASE_MS, None)
        except zenoh.ZError as error:
            raise Refused(f"no lockstep run at {endpoint}: {reason_of(error)}") from None
        self._grants = self._session.declare_subscriber(_key(fleet, name, _GRANT, incarnation), _queue())
        self._answers = _publisher(self._session, _key(fleet, name, _ANSWER, incarnation))

    def hello(self, answer: GrantAnswer) -> TimeGrant:
        """Send `answer` until the first grant comes, and return that."""
        while True:
            self._answers.put(_encode(answer))
            until = clock.now() + HELLO_S
            while clock.now() < until:
                sample = self._grants.try_recv()
                if sample is not None:
                    return self._granted(sample)
                clock.sleep(HELLO_S / 20)

    def exchange(self, answer: GrantAnswer) -> TimeGrant:
        """Send an answer and return the next grant."""
        self._answers.put(_encode(answer))
        return self._granted(self._grants.recv())

    @staticmethod
    def _granted(sample: zenoh.Sample) -> TimeGrant:
        return _grants.decode(sample.payload.to_bytes())


class GrantHub:
    """The run's end of all links: a router in this process, without other clients than its processes and operators."""

    def __init__(self, endpoint: str, fleet: str) -> None:
        """Listen at `endpoint`. Raises Refused if that cannot be."""
        check_listen(endpoint, None, False)
        self._fleet = fleet
        self._path = socket_path(endpoint)
        mask = os.umask(0o077)  # for the unix socket: 0600
        try:
            self._session = open_session(session_config("router", [endpoint], [], LINK_LEASE_MS, None), CLIENT_THREADS)
        except zenoh.ZError as error:
            raise Refused(f"listen {endpoint}: {reason_of(error)}") from None
        finally:
            os.umask(mask)
        self._grants: dict[str, zenoh.Publisher] = {}
        self._inbox = self._session.declare_subscriber(_key(fleet, "*", _ANSWER, "*"), _queue())
        self._operators = self._session.declare_subscriber(key(fleet, OPERATOR_NAME, "operator"), _queue())
        self._closed = threading.Event()
        self._nudge = _key(fleet, "run", _ANSWER, _NUDGE)
        threading.Thread(target=self._nudges, daemon=True).start()

    def grant(self, name: str, incarnation: int, grant: TimeGrant) -> None:
        """Send a grant to a process."""
        to = _key(self._fleet, name, _GRANT, incarnation)
        publisher = self._grants.get(to)
        if publisher is None:
            publisher = self._grants[to] = _publisher(self._session, to)
        publisher.put(_encode(grant))

    def receive(self) -> tuple[str, int, GrantAnswer] | None:
        """Return the next answer with its sender's name and incarnation; None now and then, also while none comes."""
        sample = self._inbox.recv()
        _, _, name, _, incarnation = str(sample.key_expr).split("/")
        try:
            return name, int(incarnation), _answers.decode(sample.payload.to_bytes())
        except (ValueError, msgspec.MsgspecError):  # a nudge, or bytes of a stranger
            return None

    def orders(self) -> Iterator[bytes]:
        """Yield the operators' messages since the last call."""
        while (sample := self._operators.try_recv()) is not None:
            yield sample.payload.to_bytes()

    def publish(self, envelope: Envelope) -> None:
        """Publish a message to operators."""
        self._session.put(envelope.key, encode(envelope.message))

    def close(self) -> None:
        """Close all links; the socket is removed."""
        self._closed.set()
        self._session.close()  # type: ignore[no-untyped-call]
        if self._path is not None:
            self._path.unlink(missing_ok=True)

    def _nudges(self) -> None:
        while not self._closed.wait(NUDGE_S):
            try:
                self._session.put(self._nudge, b"")
            except zenoh.ZError:  # closed meanwhile
                return


def _queue() -> Any:
    return zenoh.handlers.FifoChannel(WAITING_MAX)


def _publisher(session: zenoh.Session, to: str) -> zenoh.Publisher:
    return session.declare_publisher(
        to,
        congestion_control=zenoh.CongestionControl.BLOCK,
        priority=zenoh.Priority.REAL_TIME,
        express=True,
    )
