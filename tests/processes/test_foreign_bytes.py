"""Bytes from strangers on every key of a running fleet: counted, dropped, and nobody stops for them."""

from __future__ import annotations

from random import Random

import pytest

from lfa.protocol.messages.codec import BadMessage, decode
from lfa.protocol.messages.consensus import Role
from lfa.protocol.messages.team import Status, Tracking
from lfa.protocol.topics import TOPIC, TOPICS, address, key
from lfa.protocol.transport.bus import Inbox
from lfa.protocol.transport.zenoh_bus import ZenohBus
from tests.processes.test_by_hand import FLEET, Terminals, terminals
from tests.rigs.lfa_runs import eventually

__all__ = ["terminals"]

pytestmark = pytest.mark.processes

OWNERS = ("robot1", "robot2", "robot9", "world", "witness", "sim", "operator")
ROUNDS = 5


class Stranger:
    """Hears what the fleet says, and says what nobody should: random, cut and misplaced bytes."""

    def __init__(self, endpoint: str) -> None:
        self._inbox = Inbox(every=True)
        self._bus = ZenohBus(endpoint, self._inbox)
        self._bus.follow(frozenset({f"lfa/{FLEET}/**"}))
        self._random = Random(1)
        self.real: dict[str, bytes] = {}
        self.undecodable: dict[str, float] = {}
        self.tracked: set[str] = set()
        self.roles: dict[str, Role] = {}

    def listen(self) -> None:
        for arrival in self._inbox.take():
            where = address(arrival.key)
            if where is None or where.topic not in TOPIC or not isinstance(arrival.payload, bytes):
                continue
            try:
                message = decode(arrival.payload, TOPIC[where.topic].type)
            except BadMessage:
                continue
            self.real[where.topic] = arrival.payload
            if isinstance(message, Status):
                self.undecodable[message.header.sender] = message.counters.get("undecodable", 0.0)
                self.roles[message.header.sender] = message.role
            elif isinstance(message, Tracking):
                self.tracked.add(message.header.sender)

    def babble(self) -> None:
        """Once on every topic of every owner, and a life that no number of a message holds."""
        self._bus.announce(FLEET, "robot1", 10 ** self._random.randrange(19, 4000))
        for topic in TOPICS:
            for owner in OWNERS:
                for to in ("all", "robot1", "gateway2") if topic.name == "lease" else (None,):
                    self._bus.publish(key(FLEET, owner, topic.name, to), self._nonsense(topic.name))

    def leave(self) -> None:
        self._bus.close()

    def _nonsense(self, topic: str) -> bytes:
        kind = self._random.randrange(3)
        real = self.real.get(topic, b"\x93\x01")
        if kind == 0:
            return self._random.randbytes(self._random.randrange(200))
        if kind == 1:
            return real[: self._random.randrange(len(real))]
        others = [payload for name, payload in sorted(self.real.items()) if name != topic]
        return self._random.choice(others) if others else b""


def test_strangers_bytes_on_every_key_are_counted_and_dropped(terminals: Terminals) -> None:
    processes = [terminals.router(), terminals.world(), terminals.agent(1, "leader"), terminals.agent(2)]
    stranger = Stranger(terminals.endpoint)
    try:

        def follows() -> bool:
            stranger.listen()
            return "robot2" in stranger.tracked

        eventually(follows, "robot 2 follows nobody")
        for _ in range(ROUNDS):
            stranger.babble()
            stranger.listen()
        stranger.tracked.clear()

        def counted() -> bool:
            stranger.listen()
            return all(stranger.undecodable.get(f"robot{n}", 0.0) > 0.0 for n in (1, 2))

        eventually(counted, f"no agent counted them: {stranger.undecodable}")
        eventually(follows, "robot 2 follows nobody any more")
    finally:
        stranger.leave()
    assert [process.poll() for process in processes] == [None] * 4
    assert stranger.roles["robot1"] is Role.LEADER
