"""Outgoing messages of a process: headers, sequence numbers, keys, and the envelopes still to be sent."""

from __future__ import annotations

from typing import Any

from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.consensus import Term
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import Event
from lfa.protocol.node import Envelope
from lfa.protocol.topics import TOPIC, key


class Outbox:
    """Sender side of the messages of one incarnation of the process `name`, with a sequence number for each topic."""

    def __init__(self, fleet: str, name: str, incarnation: int, owner: str | None = None, first: int = 0) -> None:
        """Create an outbox for the keys of `owner`, by default the sender's own; `first` is the first number."""
        self.fleet = fleet
        self.name = name
        self.incarnation = incarnation
        self._next: dict[str, int] = {}
        self._first = first
        self._keys = {topic: key(fleet, owner or name, topic) for topic in TOPIC}
        self._out: list[Envelope] = []

    def header(self, topic: str, now: float) -> Header:
        """Return the next header on `topic`."""
        number = self._next.get(topic, self._first)
        self._next[topic] = number + 1
        return Header(self.name, self.incarnation, number, now)

    def key(self, topic: str) -> str:
        """Return the owner's key of `topic`."""
        return self._keys[topic]

    def envelope(self, topic: str, message: Message, to: str | None = None) -> Envelope:
        """Return `message` with its key, for a caller that sends it by itself."""
        own = self._keys[topic]
        return Envelope(own if to is None else f"{own}/{to}", message)

    def event_envelope(self, kind: str, now: float, term: Term | None, data: dict[str, Any]) -> Envelope:
        """Return an event, which becomes a line of `events.jsonl`, with its key."""
        return self.envelope("event", Event(self.header("event", now), kind, term, data))

    def publish(self, topic: str, message: Message, to: str | None = None) -> None:
        own = self._keys[topic]
        self._out.append(Envelope(own if to is None else f"{own}/{to}", message))

    def event(self, kind: str, now: float, term: Term | None, data: dict[str, Any]) -> None:
        """Publish an event."""
        self._out.append(self.event_envelope(kind, now, term, data))

    def drain(self) -> list[Envelope]:
        """Return and clear the envelopes published since the last call."""
        out, self._out = self._out, []
        return out
