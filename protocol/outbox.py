"""How an agent speaks: headers, sequence numbers and keys, and what is still to be sent."""

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
    """The sender's side of every message of one life of one robot."""

    def __init__(self, fleet: str, robot_id: int, incarnation: int) -> None:
        self.fleet = fleet
        self.name = robot_name(robot_id)
        self.incarnation = incarnation
        self._seq: dict[str, int] = {}
        self._keys = {topic: key(fleet, self.name, topic) for topic in TOPIC}
        self._out: list[Envelope] = []

    def header(self, topic: str, now: float) -> Header:
        """The next header on `topic`."""
        seq = self._seq[topic] = self._seq.get(topic, -1) + 1
        return Header(self.name, self.incarnation, seq, now)

    def key(self, topic: str) -> str:
        """This robot's own key of `topic`."""
        return self._keys[topic]

    def publish(self, topic: str, message: Message, to: str | None = None) -> None:
        own = self._keys[topic]
        self._out.append(Envelope(own if to is None else f"{own}/{to}", message))

    def event(self, kind: str, now: float, term: Term | None, data: dict[str, Any]) -> None:
        """A line for `events.jsonl`."""
        self.publish("event", Event(self.header("event", now), kind, term, data))

    def drain(self) -> list[Envelope]:
        """All that was said since the last call."""
        out, self._out = self._out, []
        return out
