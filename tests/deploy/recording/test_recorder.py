"""What is recorded can be read back: all of it, or all but the end when the writer was cut off."""

from __future__ import annotations

import json
from io import BytesIO
from math import inf, isnan, nan
from pathlib import Path

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import Writer
from msgspec import structs

from lfa.deploy.recording import event_log, mcap_channels, mcap_reader
from lfa.deploy.recording.mcap_writer import ChunkWriter
from lfa.deploy.recording.recorder import EVENTS, RECORDING, TIME_S_MAX, Recorder, parts
from lfa.protocol.errors import Refused
from lfa.protocol.lease.membership import first_config
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.consensus import LeaseNote, Member, Nack, Term
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import LaserScan
from lfa.protocol.messages.simulation import TrueRobot, Truth
from lfa.protocol.messages.team import Event, MissionNote, OperatorNote
from lfa.protocol.output import AppendedFile
from lfa.protocol.topics import TOPICS, key
from lfa.world.description.load import shipped
from tests.rigs.small_disk import fill, small_disk

HEADER = Header("robot2", 7, 3, 12.5)


def _scan(ranges_m: tuple[float, ...]) -> LaserScan:
    return LaserScan(HEADER, -3.1, 0.035, 0.05, 8.0, ranges_m)


def _truth(time_s: float) -> Truth:
    return Truth(Header("world", 1, round(time_s * 50), time_s), time_s, (TrueRobot(1, time_s, 0.0, 0.0, 1.0, 0.0),))


def test_a_scans_beams_out_of_range_are_recorded(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, {})
    recorder.record(0.1, key("f", "robot2", "scan"), _scan((1.5, inf, -inf, nan)))
    recorder.close()
    ((owner, topic, t, scan),) = mcap_reader.messages(tmp_path, frozenset({"scan"}))
    assert (owner, topic, t) == ("robot2", "scan", 0.1)
    ranges = [float(r) for r in scan.ranges_m]
    assert ranges[:3] == [1.5, inf, -inf]
    assert isnan(ranges[3])


def test_no_number_that_a_member_may_say_ends_the_recorder(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, {})
    for t, seq in ((0.1, 2**53), (inf, 1), (nan, 2), (1e308, 3)):
        scan = structs.replace(_scan((1.0,)), header=Header("robot2", 7, seq, t))
        recorder.record(t, key("f", "robot2", "scan"), scan)
    recorder.close()
    times = [t for _, _, t, _ in mcap_reader.messages(tmp_path, frozenset({"scan"}))]
    assert times == [0.1, TIME_S_MAX, 0.0, TIME_S_MAX]


def test_a_message_of_a_time_that_no_recorder_writes_is_refused(tmp_path: Path) -> None:
    with (tmp_path / RECORDING).open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channel = writer.register_channel("/robot2/scan", "json", writer.register_schema("LaserScan", "", b""))
        writer.add_message(channel, 2**63, mcap_channels.encode(_scan((1.0,))), 0)
        writer.finish()
    with pytest.raises(Refused, match="by another program, or damaged"):
        list(mcap_reader.recorded(tmp_path, frozenset({"scan"})))


def test_the_schema_says_that_a_range_may_be_a_word(tmp_path: Path) -> None:
    schema = json.loads(mcap_channels.schema(LaserScan))
    items = schema["$defs"]["LaserScan"]["properties"]["ranges_m"]["items"]
    assert {"type": "number"} in items["anyOf"]
    assert {"enum": ["-inf", "inf", "nan"]} in items["anyOf"]


@pytest.mark.parametrize("topic", TOPICS, ids=[topic.name for topic in TOPICS])
def test_every_topic_has_a_schema_with_names(topic: object) -> None:
    schema = json.loads(mcap_channels.schema(topic.type))  # type: ignore[attr-defined]
    assert "header" in schema["$defs"][topic.type.__name__]["properties"]  # type: ignore[attr-defined]


def test_what_a_union_holds_keeps_its_tag() -> None:
    config = first_config(shipped()["straight"].mission)
    note = LeaseNote(HEADER, Nack(Term(1, 2, 3), Term(2, 1, 1), Member(1, 5), inf, config))
    body = json.loads(mcap_channels.encode(note))["body"]
    assert body["type"] == "nack"
    assert body["remaining_s"] == "inf"
    assert body["holder"] == {"id": 1, "incarnation": 5}


@given(ranges=st.lists(st.floats(allow_nan=False), max_size=20))
def test_every_number_survives(ranges: list[float]) -> None:
    read = msgspec.json.decode(mcap_channels.encode(_scan(tuple(ranges))), type=mcap_channels.shape(LaserScan))
    assert [float(r) for r in read.ranges_m] == ranges  # type: ignore[attr-defined]


@settings(max_examples=30)
@given(part=st.floats(0.0, 1.0))
def test_a_recording_cut_off_anywhere_can_be_read(part: float, tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = tmp_path_factory.mktemp("cut")
    recorder = Recorder(folder, {})
    for step in range(200):
        recorder.record(step * 0.02, key("f", "sim", "truth"), _truth(step * 0.02))
    recorder.close()
    whole = (folder / RECORDING).read_bytes()
    (folder / RECORDING).write_bytes(whole[: int(part * len(whole))])
    seen = mcap_reader.read(folder)
    for rows in seen.truth.values():
        assert (rows[:, 1] == rows[:, 0]).all()


@given(stamps=st.lists(st.integers(0, 2**40), max_size=30), flush_at=st.integers(0, 30))
def test_the_quick_writer_writes_what_the_library_writes(
    stamps: list[int], flush_at: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path, stream = tmp_path_factory.mktemp("quick") / RECORDING, BytesIO()
    for writer in (Writer(stream, 200), ChunkWriter(AppendedFile(path), 200)):
        writer.start("", "lfa")
        writer.add_metadata("run", {"seed": "1"})
        schema = writer.register_schema("lfa.A", "jsonschema", b"{}")
        channels_of = [writer.register_channel(name, "json", schema) for name in ("/a", "/b")]
        for n, stamp in enumerate(stamps):
            writer.add_message(channels_of[n % 2], stamp, b"%d" % n, stamp + n, n)
            if n == flush_at:
                writer.flush()
        writer.finish()
    assert path.read_bytes() == stream.getvalue()


def test_a_killed_recorder_loses_no_more_than_a_second(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, {})
    for step in range(226):
        recorder.record(step * 0.02, key("f", "sim", "truth"), _truth(step * 0.02))
    assert mcap_reader.read(tmp_path).end_s > 4.5 - 1.1  # never closed


def _record_many(folder: Path, **options: int) -> Recorder:
    """A minute of ground truth, with an event at its start."""
    recorder = Recorder(folder, {"seed": "1"}, **options)
    for step in range(3000):
        recorder.record(step * 0.02, key("f", "sim", "truth"), _truth(step * 0.02))
    return recorder


def test_a_recording_in_several_files_is_read_as_one(tmp_path: Path) -> None:
    recording = _record_many(tmp_path, split_bytes=20_000).close()
    assert recording.files == len(parts(tmp_path)) > 2
    assert recording.messages == 3000
    assert recording.bytes == sum(path.stat().st_size for path in parts(tmp_path))
    rows = mcap_reader.read(tmp_path).truth[1]
    assert rows.shape[0] == 3000
    assert (rows[1:, 0] > rows[:-1, 0]).all()


def test_each_of_several_files_can_be_read_by_itself(tmp_path: Path) -> None:
    _record_many(tmp_path, split_bytes=20_000).close()
    for path in parts(tmp_path):
        with path.open("rb") as stream:
            seen = [(schema.name, channel.topic) for schema, channel, _ in make_reader(stream).iter_messages()]
        assert set(seen) == {("lfa.Truth", "/sim/truth")}


def test_of_several_files_the_first_and_the_newest_are_kept(tmp_path: Path) -> None:
    recorder = _record_many(tmp_path, split_bytes=20_000, keep=2)
    recorder.close()
    first, newest = parts(tmp_path)
    assert first.name == RECORDING
    assert mcap_reader.read(tmp_path).end_s > 59.0
    assert newest.name > "recording-0002.mcap"


def test_a_killed_recorder_of_several_files_loses_no_more_than_a_second(tmp_path: Path) -> None:
    _record_many(tmp_path, split_bytes=20_000)  # never closed
    assert mcap_reader.read(tmp_path).end_s > 59.98 - 1.1


def test_an_event_is_a_line_about_the_robot_that_it_is_about(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, {})
    accepted = Event(Header("world", 1, 1, 99.0), "leader_command", Term(3, 2, 1), {"robot": 2, "t": 8.25})
    own = Event(HEADER, "lease", Term(3, 2, 1), {"change": "acquired", "t": "not a time"})
    recorder.record(8.3, key("f", "world", "event"), accepted)
    recorder.record(8.4, key("f", "robot2", "event"), own)
    recorder.close()
    first, second = (tmp_path / EVENTS).read_text().splitlines()
    assert first == '{"t":8.25,"robot":2,"term":[3,2,1],"kind":"leader_command","from":"world"}'
    assert second == '{"t":8.4,"robot":2,"term":[3,2,1],"kind":"lease","from":"robot2","change":"acquired"}'


def test_a_last_line_cut_off_by_a_kill_is_left_out(tmp_path: Path) -> None:
    (tmp_path / EVENTS).write_bytes(b'{"t":1.0,"robot":1,"term":null,"kind":"contact","from":"robot1"}\n{"t":2.0,"rob')
    assert [line["t"] for line in event_log.lines(tmp_path)] == [1.0]


ANYTHING = st.dictionaries(st.text(), st.recursive(st.none() | st.floats() | st.text(), st.lists, max_leaves=4))
MESSAGES = [
    st.builds(Event, data=ANYTHING),
    st.builds(OperatorNote, arguments=ANYTHING),
    st.builds(MissionNote, mission=st.sampled_from([scenario.mission for scenario in shipped().values()])),
    *(st.from_type(topic.type) for topic in TOPICS if topic.type not in (Event, OperatorNote, MissionNote)),
]


@settings(max_examples=200)
@given(message=st.one_of(*MESSAGES))
def test_every_message_becomes_an_object_of_its_schemas_type(message: Message) -> None:
    written = mcap_channels.encode(message)
    assert json.loads(written) == json.loads(msgspec.json.encode(mcap_channels.plain(message)))
    msgspec.json.decode(written, type=mcap_channels.shape(type(message)))


def test_a_full_disk_costs_messages_and_neither_recorder_nor_recording(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with small_disk(tmp_path / "disk", 256) as disk:
        recorder = Recorder(disk, {"seed": "1"})
        filler = None
        for step in range(1000):
            t = step * 0.02
            if step == 200:
                filler = fill(disk)
            if step == 600 and filler is not None:
                filler.unlink()
            recorder.record(t, key("f", "sim", "truth"), _truth(t))
            recorder.record(t, key("f", "robot2", "event"), Event(HEADER, "role", None, {}))
        recording = recorder.close()
        seen = [t for _, _, t, _ in mcap_reader.messages(disk, frozenset({"truth"}))]
        assert len(seen) + recording.unwritten // 2 == 1000
        assert recording.messages == 2 * len(seen)
        assert seen[0] < 1.0 and seen[-1] == pytest.approx(19.98), "it goes on when there is room"
        assert [t for t in seen if 5.0 < t < 11.0] == []
        assert all(line.endswith(b"}") for line in (disk / EVENTS).read_bytes().splitlines())
    said = capsys.readouterr().err.splitlines()
    assert [line.partition(": ")[2] for line in said] == [
        "No space left on device: messages are lost until there is room",
        "there is room again: goes on",
    ]
