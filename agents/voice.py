"""How an agent speaks: headers, sequence numbers and keys, so that no other file counts or spells them."""

from __future__ import annotations

from protocol.messages import Header
from protocol.mission import robot_name
from protocol.topics import TOPIC, key


class Voice:
    """The sender's side of every message of one life of one robot."""

    def __init__(self, fleet: str, robot_id: int, incarnation: int) -> None:
        self.fleet = fleet
        self.name = robot_name(robot_id)
        self.incarnation = incarnation
        self._seq: dict[str, int] = {}
        self._keys = {topic: key(fleet, self.name, topic) for topic in TOPIC}

    def header(self, topic: str, now: float) -> Header:
        """The next header on `topic`."""
        seq = self._seq[topic] = self._seq.get(topic, -1) + 1
        return Header(self.name, self.incarnation, seq, now)

    def key(self, topic: str, to: str | None = None) -> str:
        own = self._keys[topic]
        return own if to is None else f"{own}/{to}"
