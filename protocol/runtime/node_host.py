"""A Node with its journal, codec and counters: the part of a runner that real and virtual time share.

Input and output are bytes. Undecodable input is counted and dropped here: a core gets well-formed messages only.
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from lfa.protocol.messages.codec import BadMessage, Message, decode, encode
from lfa.protocol.node import Envelope, Local, Node, NodeObserver, Received
from lfa.protocol.runtime.journal import Journal
from lfa.protocol.topics import expected_on

Sent = list[tuple[str, bytes]]

encode_local = msgspec.msgpack.Encoder().encode


class NodeHost:
    """Adapter that calls one Node and keeps its journal. Each call returns the encoded messages to publish."""

    def __init__(self, node: Node, journal: Journal, observers: Sequence[NodeObserver] = ()) -> None:
        """Host `node`; `observers` hear each of its inputs."""
        self.node = node
        self.journal = journal
        self._observers = observers
        self.undecodable = 0

    def decoded(self, key: str, payload: bytes) -> Message | None:
        """Return the message in `payload`; if foreign, malformed or in another's name, count it and return None."""
        expected = expected_on(key)
        try:
            message = None if expected is None else decode(payload, expected.kind)
        except BadMessage:
            message = None
        if expected is None or message is None or message.header.sender not in expected.signers:
            self.undecodable += 1
            return None
        return message

    def message(self, at: float, key: str, payload: bytes) -> Sent:
        """Decode and deliver `payload`, received on `key` at `at` [s]; return the messages to publish."""
        message = self.decoded(key, payload)
        return [] if message is None else self.deliver(at, key, message, payload)

    def deliver(self, at: float, key: str, message: Message | Local, payload: bytes) -> Sent:
        """Deliver a decoded message with its bytes, or a local event (`key`, `payload` empty), and journal the call."""
        received = Received(at, key, message)
        if self._observers:
            envelopes = self._observed(received)
        else:
            envelopes = self.node.receive(received)
        sent = _encoded(envelopes) if envelopes else []
        if key:
            self.journal.add("message", at, key, payload, sent)
        else:
            self.journal.add("local", at, "", encode_local(message), sent)
        return sent

    def tick(self, now: float) -> Sent:
        """Tick the node at `now` [s] and journal the call; return the messages to publish."""
        sent = _encoded(self.node.tick(now))
        self.journal.add("tick", now, "", b"", sent)
        return sent

    def _observed(self, received: Received) -> list[Envelope]:
        for observer in self._observers:
            observer.before(received)
        envelopes = self.node.receive(received)
        for observer in self._observers:
            observer.after(received)
        return envelopes

    def end(self) -> None:
        """Close the journal of a node that has ended."""
        self.journal.close()


def _encoded(envelopes: list[Envelope]) -> Sent:
    return [(envelope.key, encode(envelope.message)) for envelope in envelopes]
