"""Journals of other machines, brought into one folder."""

from __future__ import annotations

import io
import subprocess
import sys
import tarfile
from pathlib import Path

from lfa.deploy.fleet.host.end import ANSWER
from lfa.deploy.fleet.plan.fleet_file import load
from lfa.deploy.fleet.remote import journals


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
