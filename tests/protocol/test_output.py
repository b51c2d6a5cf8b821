"""No place that refuses a line or an entry can end the process that writes it."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

from lfa.protocol.output import AppendedFile, replace_file, write_line
from tests.rigs.small_disk import fill, read_only, small_disk
from tests.test_imports import ROOT

LONG_LIVED = (
    *(ROOT / "protocol").rglob("*.py"),
    *(ROOT / "agents").rglob("*.py"),
    *(ROOT / "world").glob("*.py"),
    *(ROOT / "deploy/robot").rglob("*.py"),
    *(ROOT / "deploy/process").rglob("*.py"),
    *(ROOT / "deploy/fleet/host" / name for name in ("supervisor.py", "guardian.py", "router.py")),
    ROOT / "deploy/fleet/engine/log_tail.py",
    *(ROOT / "deploy/recording" / name for name in ("recorder.py", "mcap_writer.py")),
    ROOT / "deploy/run/launch.py",
    ROOT / "deploy/run/progress.py",
    ROOT / "deploy/run/recorder_process.py",
)


def _raw_writes(path: Path) -> list[str]:
    """Calls of print, and writes to files and streams, in `path`."""
    calls = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)]
    named = [(call.lineno, ast.unparse(call.func)) for call in calls]
    raw = ("print", "sys.stdout.write", "sys.stderr.write", "os.write")
    return [f"{path.relative_to(ROOT)}:{line}: {name}" for line, name in named if name in raw or "write_bytes" in name]


def test_processes_that_drive_or_watch_write_in_one_way() -> None:
    own = (
        "protocol/output.py", "protocol/transport/bus.py", "deploy/robot/watchdog.py",
        "protocol/program_start/installed_first.py",  # before a module of lfa can be imported, and then it ends
    )  # fmt: skip
    found = [line for path in LONG_LIVED for line in _raw_writes(path) if not line.startswith(own)]
    assert not found, "use lfa.protocol.output: " + ", ".join(found)


def test_a_line_to_a_full_device_is_dropped() -> None:
    with open("/dev/full", "w") as full:
        write_line("text", full)


def test_a_line_to_a_closed_or_a_full_pipe_is_dropped() -> None:
    out, into = os.pipe()
    with os.fdopen(into, "w") as stream:
        for _ in range(1000):
            write_line("x" * 1000, stream)
        os.close(out)
        write_line("text", stream)
    write_line("text", stream)


def test_a_line_in_a_process_started_without_stderr_goes_to_no_other_file(tmp_path: Path) -> None:
    """The number 2 is then the first file that the process opens."""
    code = f"import sys; f = open({str(tmp_path / 'other')!r}, 'wb'); assert f.fileno() == 2, f.fileno(); "
    code += "from lfa.protocol.output import write_line; write_line('text', sys.stderr)"
    done = subprocess.run([sys.executable, "-c", code], preexec_fn=lambda: os.close(2), check=False)
    assert done.returncode == 0
    assert (tmp_path / "other").read_bytes() == b""


def test_a_piece_that_the_disk_takes_in_part_is_cut_off_again(tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", 64) as disk:
        file = AppendedFile(disk / "pieces")
        assert file.append(b"a" * 30_000)
        assert not file.append(b"b" * 60_000)
        assert (file.error, file.path.stat().st_size) == ("No space left on device", 30_000)
        assert file.append(b"c" * 10_000)
        assert file.path.read_bytes() == b"a" * 30_000 + b"c" * 10_000
        file.close()
        assert not file.append(b"d")


def test_a_file_is_replaced_whole_or_stays_as_it_was(tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", 64) as disk:
        path = disk / "state.json"
        assert replace_file(path, b"first") == ""
        filler = fill(disk)
        assert replace_file(path, b"x" * 9000) == "No space left on device"
        assert [one.name for one in disk.iterdir() if one != filler] == ["state.json"]
        with read_only(disk):
            assert replace_file(path, b"third") == "Read-only file system"
        assert path.read_bytes() == b"first"


def test_a_link_or_a_pipe_that_another_user_has_put_in_place_is_neither_followed_nor_waited_for(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_bytes(b"theirs")
    (tmp_path / "state.json.new").symlink_to(victim)
    assert replace_file(tmp_path / "state.json", b"ours") == ""
    assert (victim.read_bytes(), (tmp_path / "state.json").read_bytes()) == (b"theirs", b"ours")
    (tmp_path / "link").symlink_to(victim)
    os.mkfifo(tmp_path / "pipe")
    for name in ("link", "pipe"):
        with pytest.raises(OSError, match=r"Too many levels of symbolic links|No such device or address"):
            AppendedFile(tmp_path / name)
