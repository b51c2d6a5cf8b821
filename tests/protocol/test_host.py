"""A host feeds its node well-formed messages only, counts the rest, and journals what each call returned."""

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from protocol.host import Host
from protocol.journal import JOURNAL_VERSION, Heading, Journal, digest, read
from protocol.messages import Ask, Header, MissionNote, encode
from protocol.mission import Leading, Mission
from protocol.node import Stop
from protocol.topics import TOPICS, key
from protocol.witness import Witness

MISSION = Mission(leading=Leading(route_m=((0.0, 0.0), (5.0, 0.0))))


def host_of(folder: Path | None = None) -> Host:
    return Host(Witness("f", 1, 1), Journal(folder, Heading(JOURNAL_VERSION, "witness", 1, 1, {})))


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


def test_a_witness_without_a_mission_asks_for_one() -> None:
    sent = dict(host_of().tick(0.5))
    assert sent[key("f", "witness", "ask")] == encode(Ask(Header("witness", 1, 0, 0.5), "mission"))
