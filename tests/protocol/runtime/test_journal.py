"""A journal is read up to its last whole entry, however its writer ended."""

import errno
import os
from pathlib import Path

import pytest

from lfa.protocol.errors import Refused
from lfa.protocol.runtime.journal import JOURNAL_VERSION, Heading, Journal, digest, read
from lfa.protocol.runtime.node_runner import _NodeRunner
from lfa.protocol.transport.bus import Inbox
from lfa.protocol.witness import Witness
from tests.rigs.small_disk import fill, small_disk

HEADING = Heading(JOURNAL_VERSION, "robot2", 17, 3, {"fleet": "f"})


def written(folder: Path) -> Path:
    journal = Journal(folder, HEADING)
    for n in range(10):
        journal.add("message", float(n), "lfa/f/robot1/pose", bytes([n]) * n, [("k", bytes([n]))])
    journal.add("tick", 10.0, "", b"", [])
    journal.close()
    return folder / "robot2-17.bin"


def test_entries_come_back_in_order_with_the_digest_of_what_was_returned(tmp_path: Path) -> None:
    heading, entries = read(written(tmp_path))
    listed = list(entries)
    assert heading == HEADING
    assert [entry.at for entry in listed] == [float(n) for n in range(11)]
    assert listed[3].digest == digest([("k", b"\x03")])
    assert listed[-1].digest == 0


def test_a_file_cut_anywhere_is_read_up_to_its_last_whole_entry(tmp_path: Path) -> None:
    path = written(tmp_path)
    data = path.read_bytes()
    whole = list(read(path)[1])
    heading_bytes = 4 + int.from_bytes(data[:4], "little")
    for cut in range(heading_bytes, len(data)):
        path.write_bytes(data[:cut])
        entries = list(read(path)[1])
        assert entries == whole[: len(entries)], f"cut at byte {cut}"
        assert len(entries) < len(whole)


def test_a_byte_changed_within_an_entry_is_refused_by_the_entrys_number(tmp_path: Path) -> None:
    path = written(tmp_path)
    path.write_bytes(path.read_bytes().replace(b"message", b"m\xffssage", 1))
    with pytest.raises(Refused, match="entry 1 cannot be read"):
        list(read(path)[1])


def test_on_a_full_disk_the_journal_ends_with_a_line_and_its_writer_goes_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with small_disk(tmp_path / "disk", 16) as disk:
        fill(disk)
        written(disk)
    said = capsys.readouterr().err
    assert said == f"{disk / 'robot2-17.bin'}: No space left on device: the journal ends here\n"


def test_a_full_disk_at_the_start_costs_the_journal_and_not_the_robot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*_: object, **__: object) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "open", full)
    Journal(tmp_path, HEADING).close()
    assert "No space left on device: the journal ends here" in capsys.readouterr().err


def test_a_journal_where_none_can_be_written_is_refused_in_a_line(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(Refused, match=r"--journal .*file.*: must be a folder to write to"):
        Journal(tmp_path / "file", HEADING)


def test_what_is_no_journal_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.bin"
    for content in (b"", b"abc", b"\x05\x00\x00\x00hello"):
        path.write_bytes(content)
        with pytest.raises(ValueError, match="not a journal"):
            read(path)


def test_a_digest_tells_a_changed_payload_and_a_changed_key_apart() -> None:
    assert digest([("a", b"1")]) != digest([("a", b"2")])
    assert digest([("a", b"1")]) != digest([("b", b"1")])


class Witnessing:
    """A bus that looks, whenever something is said, at how much of the journal is on disk."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.on_disk: list[int] = []

    def publish(self, key: str, payload: bytes) -> None:
        self.on_disk.append(len(list(read(self.path)[1])))

    def follow(self, interests: frozenset[str]) -> None: ...


def test_what_is_said_was_journalled_before(tmp_path: Path) -> None:
    """Whoever is killed with a message on the wire has left the record that explains it (a PROPOSE its promises)."""
    bus = Witnessing(tmp_path / "witness-1.bin")
    runner = _NodeRunner(
        Witness("f", 1, 1), bus, Inbox(), Journal(tmp_path, Heading(JOURNAL_VERSION, "witness", 1, 1, {})), None
    )
    runner.step(0.5)
    assert set(bus.on_disk) == {1}
