"""Messages on a bus, for programs that are no `Node`: sending, and decoding of what arrives."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Protocol

from lfa.protocol.messages.codec import Message, encode
from lfa.protocol.node import Envelope
from lfa.protocol.topics import message_in
from lfa.protocol.transport.bus import Arrival


class Publisher(Protocol):
    """Sending side of a bus, or of a simulation in its place."""

    def publish(self, key: str, payload: bytes) -> None: ...


def send(bus: Publisher, *envelopes: Envelope) -> None:
    """Publish messages, each on its key."""
    for envelope in envelopes:
        bus.publish(envelope.key, encode(envelope.message))


class Decoder:
    """Decoder of arrivals; what is no message of its key's topic is dropped, and counted in `undecodable`."""

    def __init__(self) -> None:
        self.undecodable = 0

    def messages(self, arrivals: Iterable[Arrival]) -> Iterator[tuple[Arrival, Message]]:
        """Yield the messages among `arrivals`, each with its arrival."""
        for arrival in arrivals:
            message = self.message(arrival)
            if message is not None:
                yield arrival, message

    def message(self, arrival: Arrival) -> Message | None:
        """Return the message; None for a local event, a foreign key, and bytes that do not decode."""
        if not isinstance(arrival.payload, bytes):
            return None
        message = message_in(arrival.key, arrival.payload)
        self.undecodable += message is None
        return message
