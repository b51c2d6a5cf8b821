"""Journals of other machines, brought into one folder."""

from __future__ import annotations

import asyncio
import io
import subprocess
import sys
import tarfile
import threading
from contextlib import suppress
from pathlib import Path

import pytest

from lfa.deploy.fleet.host.end import ANSWER
from lfa.deploy.fleet.plan.fleet_file import load
from lfa.deploy.fleet.remote import journals, ssh
from lfa.deploy.fleet.remote.ssh import Here, Unreachable


def _state(tmp_path: Path) -> Path:
    """What two runs leave on a machine."""
    for run, content in (("older", b"old"), ("newer", b"new")):
        folder = tmp_path / "state" / run / "journal"
        folder.mkdir(parents=True)
        (folder / "robot2-7.bin").write_bytes(content)
        (folder / "notes.txt").write_text("no journal")
    return tmp_path / "state"


def test_the_newest_runs_journals_come(tmp_path: Path) -> None:
    packed = subprocess.run(
        [sys.executable, "-c", journals.PACK, str(_state(tmp_path))], capture_output=True, check=True
    ).stdout
    assert journals.unpack(packed.removeprefix(ANSWER.encode()), tmp_path / "here") == 1
    assert (tmp_path / "here" / "journal" / "robot2-7.bin").read_bytes() == b"new"


def test_the_journals_of_every_machine_of_a_fleet_file_come(tmp_path: Path) -> None:
    file = tmp_path / "fleet.toml"
    file.write_text(f'scenario = "straight"\n[hosts.here]\nstate = "{_state(tmp_path)}"\n')
    assert journals.fetch(load(file), tmp_path / "run") == (1, [])
    assert (tmp_path / "run" / "journal" / "robot2-7.bin").read_bytes() == b"new"


def test_the_journals_of_two_machines_are_unpacked_one_after_the_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two at once that find no folder of journals would both rename their own to it."""
    both, met = threading.Barrier(2), list[bool]()

    def unpack(packed: object, run: Path) -> int:
        with suppress(threading.BrokenBarrierError):
            both.wait(0.2)
            met.append(True)
        return 1

    monkeypatch.setattr(journals, "unpack", unpack)
    state = _state(tmp_path)
    file = tmp_path / "fleet.toml"
    file.write_text(
        f'scenario = "straight"\n[hosts]\na = {{ address = "localhost", state = "{state}", router_port = 7661 }}\n'
        f'b = {{ address = "127.0.0.1", state = "{state}", router_port = 7662 }}\n'
    )
    assert journals.fetch(load(file), tmp_path / "run") == (2, [])
    assert met == []


def _sent(**contents: bytes) -> bytes:
    sent = io.BytesIO()
    with tarfile.open(fileobj=sent, mode="w") as files:
        for name, content in contents.items():
            member = tarfile.TarInfo(f"{name.replace('_', '-')}.bin")
            member.size = len(content)
            files.addfile(member, io.BytesIO(content))
    return sent.getvalue()


def _kept(run: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted((run / "journal").iterdir())}


def test_journals_of_one_name_from_two_machines_are_both_kept(tmp_path: Path) -> None:
    assert journals.unpack(_sent(robot2_7=b"machine a"), tmp_path) == 1
    assert journals.unpack(_sent(robot2_7=b"Machine b", robot3_1=b"x"), tmp_path) == 2
    assert _kept(tmp_path) == {"robot2-7-2.bin": b"Machine b", "robot2-7.bin": b"machine a", "robot3-1.bin": b"x"}


def test_a_journal_that_is_fetched_again_stands_once_in_its_latest_state(tmp_path: Path) -> None:
    for state in (b"machine a", b"machine a, later", b"machine a", b"Machine b", b"Machine b, later", b"machine"):
        journals.unpack(_sent(robot2_7=state), tmp_path)
    assert _kept(tmp_path) == {"robot2-7-2.bin": b"Machine b, later", "robot2-7.bin": b"machine a, later"}


def test_journals_of_one_name_in_two_folders_of_this_machine_are_both_copied(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "robot2-7.bin").write_text(name)
    assert journals.copy({tmp_path / "a", tmp_path / "b"}, tmp_path) == 2
    assert _kept(tmp_path) == {"robot2-7-2.bin": b"b", "robot2-7.bin": b"a"}


def test_a_machine_can_put_nothing_outside_of_the_folder(tmp_path: Path) -> None:
    sent = io.BytesIO()
    with tarfile.open(fileobj=sent, mode="w") as files:
        for name in ("../../evil.bin", "/tmp/evil.bin", "good.bin", "script.sh"):
            member = tarfile.TarInfo(name)
            member.size = 3
            files.addfile(member, io.BytesIO(b"abc"))
        link = tarfile.TarInfo("link.bin")
        link.type, link.linkname = tarfile.SYMTYPE, "/etc/passwd"
        files.addfile(link)
    journals.unpack(sent.getvalue(), tmp_path / "run")
    assert {path.name for path in tmp_path.rglob("*") if path.is_file()} == {"evil.bin", "good.bin"}
    assert all(path.parent.name == "journal" for path in tmp_path.rglob("*.bin"))


def _as_sparse(claimed: int) -> bytes:
    """A sparse file in the old form of GNU tar: no content, and `claimed` bytes of it."""
    member = tarfile.TarInfo("robot2-7.bin")
    member.type = tarfile.GNUTYPE_SPARSE
    header = bytearray(member.tobuf(tarfile.GNU_FORMAT))
    header[386:410] = b"%011o\0%011o\0" % (0, 0)
    header[483:495] = b"%011o\0" % claimed
    header[148:156] = b"%06o\0 " % (sum(header[:148]) + 8 * 32 + sum(header[156:]))
    return bytes(header) + bytes(1024)


def _as_pax_sparse(claimed: int) -> bytes:
    """The same in the form of POSIX tar, whose extended header says what size the file is to have."""
    sent = io.BytesIO()
    with tarfile.open(fileobj=sent, mode="w", format=tarfile.PAX_FORMAT) as files:
        member = tarfile.TarInfo("robot2-7.bin")
        member.pax_headers = {"GNU.sparse.size": str(claimed), "GNU.sparse.map": "0,0"}
        files.addfile(member)
    return sent.getvalue()


def _with_content() -> bytes:
    sent = io.BytesIO()
    with tarfile.open(fileobj=sent, mode="w") as files:
        member = tarfile.TarInfo("robot1-1.bin")
        member.size = 3000
        files.addfile(member, io.BytesIO(bytes(3000)))
    return sent.getvalue()


def _with_members(number: int) -> bytes:
    sent = io.BytesIO()
    with tarfile.open(fileobj=sent, mode="w") as files:
        for n in range(number):
            files.addfile(tarfile.TarInfo(f"robot1-{n}.bin"))
    return sent.getvalue()


@pytest.mark.parametrize("packed", [_as_sparse(1 << 32), _as_pax_sparse(1 << 32)], ids=["gnu", "pax"])
def test_a_machine_cannot_fill_the_disk_with_a_file_that_it_does_not_send(packed: bytes, tmp_path: Path) -> None:
    with suppress(tarfile.TarError):
        journals.unpack(packed, tmp_path / "run")
    assert sum(path.stat().st_size for path in tmp_path.rglob("*") if path.is_file()) <= len(packed)


@pytest.mark.parametrize(
    "packed",
    [
        _with_members(journals.MEMBERS_MAX + 1),
        _with_content()[:700],
        tarfile.TarInfo("x.bin").tobuf()[:200],
        b"\xff" * 512,
        b"",
    ],
    ids=["too many", "cut off", "cut off in a header", "no tar", "empty"],
)
def test_an_archive_that_is_damaged_or_endless_is_refused_and_leaves_nothing(packed: bytes, tmp_path: Path) -> None:
    with pytest.raises(tarfile.TarError):
        journals.unpack(packed, tmp_path / "run")
    assert list(tmp_path.iterdir()) == []


def test_a_machine_that_sends_without_end_is_cut_off(tmp_path: Path) -> None:
    words = (sys.executable, "-c", "while True: print('x' * 100000)")
    with (tmp_path / "sent").open("wb") as file, pytest.raises(Unreachable, match="prints more than 1 MiB"):
        asyncio.run(Here().run(words, into=file, bytes_max=1 << 20))
    assert (tmp_path / "sent").stat().st_size <= 1 << 20


def test_a_machine_that_prints_errors_without_end_is_cut_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ssh, "OUTPUT_BYTES_MAX", 1 << 20)
    words = (sys.executable, "-c", "import sys\nwhile True: sys.stderr.write('x' * 100000)")
    with pytest.raises(Unreachable, match="prints more than 1 MiB"):
        asyncio.run(Here().run(words))


def test_what_processes_here_keep_is_copied(tmp_path: Path) -> None:
    kept = tmp_path / "kept"
    kept.mkdir()
    (kept / "robot1-1.bin").write_bytes(b"x")
    sleeper = [sys.executable, "-c", "input()", "--fleet", "f1", "--journal", str(kept)]
    with subprocess.Popen(sleeper, stdin=subprocess.PIPE) as process:
        found = journals.of_processes("f1")
        process.communicate(b"\n")
    assert found == {kept}
    (tmp_path / "run").mkdir()
    assert journals.copy(found, tmp_path / "run") == 1
    assert (tmp_path / "run" / "journal" / "robot1-1.bin").read_bytes() == b"x"
