"""A host feeds its node well-formed messages only, counts the rest, and journals what each call returned."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfa.protocol.geometry import STILL
from lfa.protocol.messages.codec import encode
from lfa.protocol.messages.consensus import NO_TERM, Hello, LeaseNote, Role
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import Ask, MissionNote, PoseStamped
from lfa.protocol.mission import Leading, Mission
from lfa.protocol.node import Received, Stop
from lfa.protocol.runtime.journal import JOURNAL_VERSION, Heading, Journal, digest, read
from lfa.protocol.runtime.node_host import NodeHost
from lfa.protocol.topics import TOPIC, TOPICS, key
from lfa.protocol.witness import Witness

MISSION = Mission(leading=Leading(route_m=((0.0, 0.0), (5.0, 0.0))))


def host_of(folder: Path | None = None) -> NodeHost:
    return NodeHost(Witness("f", 1, 1), Journal(folder, Heading(JOURNAL_VERSION, "witness", 1, 1, {})))


@given(st.sampled_from([topic.name for topic in TOPICS]), st.binary(max_size=200))
def test_bytes_that_are_no_message_are_counted_and_dropped(topic: str, payload: bytes) -> None:
    host = host_of()
    assert host.message(1.0, key("f", "robot1", topic), payload) == []
    assert host.undecodable == 1


def test_a_key_of_another_system_is_counted_and_dropped() -> None:
    host = host_of()
    assert host.message(1.0, "ros/cmd_vel", b"") == []
    assert host.undecodable == 1


def test_the_journal_holds_each_call_and_the_digest_of_its_answer(tmp_path: Path) -> None:
    host = host_of(tmp_path)
    asked = host.tick(0.5)
    note = encode(MissionNote(Header("world", 1, 0, 0.6), MISSION))
    told = host.message(0.7, key("f", "world", "mission"), note)
    host.deliver(0.8, "", Stop(), b"")
    host.journal.close()
    entries = list(read(tmp_path / "witness-1.bin")[1])
    assert [entry.kind for entry in entries] == ["tick", "message", "local"]
    assert [entry.digest for entry in entries[:2]] == [digest(asked), digest(told)]
    assert entries[1].payload == note


class Diary:
    """Writes down each call."""

    def __init__(self) -> None:
        self.lines: list[tuple[str, object]] = []

    def before(self, received: Received) -> None:
        self.lines.append(("before", received.message))

    def after(self, received: Received) -> None:
        self.lines.append(("after", received.message))


def test_an_observer_hears_each_input_around_the_call_and_no_tick() -> None:
    diary = Diary()
    host = NodeHost(Witness("f", 1, 1), Journal(None, Heading(JOURNAL_VERSION, "witness", 1, 1, {})), [diary])
    host.tick(0.5)
    note = MissionNote(Header("world", 1, 0, 0.6), MISSION)
    host.message(0.7, key("f", "world", "mission"), encode(note))
    host.deliver(0.8, "", Stop(), b"")
    assert diary.lines == [("before", note), ("after", note), ("before", Stop()), ("after", Stop())]


def test_a_witness_without_a_mission_asks_for_one() -> None:
    sent = dict(host_of().tick(0.5))
    assert sent[key("f", "witness", "ask")] == encode(Ask(Header("witness", 1, 0, 0.5), "mission"))


@pytest.mark.parametrize(
    ("at", "sender", "heard"),
    [
        ("lfa/f/robot1/lease/all", "robot1", True),
        ("lfa/f/robot2/lease/all", "robot1", False),
        ("lfa/f/robot1/pose", "robot2", False),
    ],
)
def test_what_another_than_the_keys_owner_signs_is_counted_and_dropped(at: str, sender: str, heard: bool) -> None:
    """A router judges by the key, a core by the header: they must agree (replayed lease messages)."""
    topic = TOPIC[at.split("/")[3]]
    header = Header(sender, 1, 1, 0.0)
    pose = PoseStamped(header, 0.0, 0.0, 0.0, 0.0, STILL, 0.0, Role.FOLLOWER, NO_TERM)
    message = LeaseNote(header, Hello(None)) if topic.type is LeaseNote else pose
    host = host_of()
    assert (host.decoded(at, encode(message)) is not None) == heard
    assert host.undecodable == (0 if heard else 1)
