"""A Node with its journal, codec and counters: the part of a shell that real and virtual time share.

Bytes in, bytes out. What cannot be decoded is counted and dropped here, so a core only ever sees well-formed messages.
"""

from __future__ import annotations

import msgspec

from protocol.journal import Journal
from protocol.messages import BadMessage, decode, encode
from protocol.node import Envelope, Local, Node, Received
from protocol.topics import TOPIC, address

Sent = list[tuple[str, bytes]]

_local_encoder = msgspec.msgpack.Encoder()


class Host:
    """Calls one Node and keeps its journal. What a call returns is what there is to publish, encoded."""

    def __init__(self, node: Node, journal: Journal) -> None:
        self.node = node
        self.journal = journal
        self.undecodable = 0

    def message(self, at: float, key: str, payload: bytes) -> Sent:
        """Bytes came on `key`."""
        where = address(key)
        topic = TOPIC.get(where.topic) if where is not None else None
        try:
            if topic is None:
                raise BadMessage(f"no topic of ours: {key}")
            message = decode(payload, topic.type)
        except BadMessage:
            self.undecodable += 1
            return []
        sent = _encoded(self.node.receive(Received(at, key, message)))
        self.journal.add("message", at, key, payload, sent)
        return sent

    def local(self, at: float, event: Local) -> Sent:
        """A liveliness change, vitals or the order to stop."""
        sent = _encoded(self.node.receive(Received(at, "", event)))
        self.journal.add("local", at, "", _local_encoder.encode(event), sent)
        return sent

    def tick(self, now: float) -> Sent:
        """The node's deadline passed."""
        sent = _encoded(self.node.tick(now))
        self.journal.add("tick", now, "", b"", sent)
        return sent


def _encoded(envelopes: list[Envelope]) -> Sent:
    return [(envelope.key, encode(envelope.message)) for envelope in envelopes]
