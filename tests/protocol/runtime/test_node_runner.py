"""The loop around a node: in what order it lets it hear and speak."""

from pathlib import Path

from lfa.protocol.runtime.journal import JOURNAL_VERSION, Heading, Journal
from lfa.protocol.runtime.node_runner import _NodeRunner
from lfa.protocol.topics import address
from lfa.protocol.transport.bus import Inbox
from lfa.protocol.witness import Witness


class Order:
    """A bus that keeps what it is told to do."""

    def __init__(self) -> None:
        self.told: list[str] = []

    def publish(self, key: str, payload: bytes) -> None:
        where = address(key)
        assert where is not None
        self.told.append(where.topic)

    def follow(self, interests: frozenset[str]) -> None:
        self.told += ["follow", *sorted(interests)]


def test_who_asks_for_the_mission_listens_first(tmp_path: Path) -> None:
    """The world answers within a millisecond: one answer in six passed by, and the next question is half a second
    later.
    """
    bus = Order()
    journal = Journal(tmp_path, Heading(JOURNAL_VERSION, "witness", 1, 1, {}))
    _NodeRunner(Witness("f", 1, 1), bus, Inbox(), journal, None).step(0.5)
    assert bus.told[0] == "follow"
    assert "lfa/f/*/mission" in bus.told[: bus.told.index("ask")]
