"""Outgoing messages of an agent: headers, sequence numbers, keys, and the envelopes still to be sent."""

from __future__ import annotations

from typing import Any

from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.consensus import Term
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import Event
from lfa.protocol.names import robot_name
from lfa.protocol.node import Envelope
from lfa.protocol.topics import TOPIC, key


class Outbox:
    """Sender side of all messages of one incarnation of one robot."""

    def __init__(self, fleet: str, robot_id: int, incarnation: int) -> None:
        self.fleet = fleet
        self.name = robot_name(robot_id)
        self.incarnation = incarnation
        self._seq: dict[str, int] = {}
        self._keys = {topic: key(fleet, self.name, topic) for topic in TOPIC}
        self._out: list[Envelope] = []

    def header(self, topic: str, now: float) -> Header:
        """Return the next header on `topic`."""
        seq = self._seq[topic] = self._seq.get(topic, -1) + 1
        return Header(self.name, self.incarnation, seq, now)

    def key(self, topic: str) -> str:
        """Return this robot's own key of `topic`."""
        return self._keys[topic]

    def publish(self, topic: str, message: Message, to: str | None = None) -> None:
        own = self._keys[topic]
        self._out.append(Envelope(own if to is None else f"{own}/{to}", message))

    def event(self, kind: str, now: float, term: Term | None, data: dict[str, Any]) -> None:
        """Publish an event, which becomes a line of `events.jsonl`."""
        self.publish("event", Event(self.header("event", now), kind, term, data))

    def drain(self) -> list[Envelope]:
        """Return and clear the envelopes published since the last call."""
        out, self._out = self._out, []
        return out
