"""A fleet whose disk fills up drives on and answers (case `disk_full_ps`)."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import pytest

from lfa.deploy.process import identity
from lfa.deploy.process.identity import Identity, identify, own_processes
from tests.rigs.lfa_runs import LFA, eventually
from tests.rigs.small_disk import fill, small_disk

pytestmark = pytest.mark.processes

FLEET = f"full-{os.getpid()}"
TEXT = f"""
fleet = "{FLEET}"
scenario = "straight"
team = 2
restart = {{ delay_s = 0.1 }}
[hosts.here]
address = "127.0.0.1"
"""
DISK_KIB = 90 * 1024


def _lfa(home: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "HOME": str(home)}
    return subprocess.run([*LFA, *arguments], capture_output=True, text=True, timeout=90, check=False, env=environment)


def _rows(home: Path) -> dict[str, dict[str, Any]]:
    told = _lfa(home, "ps", "--json", "--fleet", FLEET)
    assert told.returncode == 0, told.stderr
    return {row["process"]: row for row in json.loads(told.stdout)["processes"]}


def _restarted(home: Path, name: str, before: int) -> bool:
    told = _lfa(home, "ps", "--json", "--fleet", FLEET)
    if told.returncode != 0:  # nobody answers while the router itself is being restarted
        return False
    row = next(row for row in json.loads(told.stdout)["processes"] if row["process"] == name)
    return bool(row["starts"] > before and row["state"] == "running")


def _kill(home: Path, name: str) -> None:
    process = identify(_rows(home)[name]["pid"])
    assert process is not None and identity.send_signal(process, signal.SIGKILL)


def _supervisor(disk: Path) -> Identity:
    (found,) = [
        one for one in own_processes() if "lfa.deploy.fleet.host.supervisor" in one.arguments and str(disk) in str(one)
    ]
    return found


def test_a_full_disk_ends_nobody() -> None:
    with (
        tempfile.TemporaryDirectory(prefix="lfa-", dir="/tmp", ignore_cleanup_errors=True) as folder,
        small_disk(Path(folder) / "home", DISK_KIB) as home,
    ):
        file = home / "fleet.toml"
        file.write_text(TEXT)
        try:
            done = _lfa(home, "up", str(file))
            assert done.returncode == 0, done.stderr
            supervisor, pids = _supervisor(home), {name: row["pid"] for name, row in _rows(home).items()}
            fill(home)
            assert {name: row["pid"] for name, row in _rows(home).items()} == pids, "the disk is full"
            for name in ("robot2", "router"):  # whoever starts on a full disk has a log and a journal to open
                _kill(home, name)
                eventually(lambda name=name: _restarted(home, name, 1), f"{name} is not started again on a full disk")
            assert {row["state"] for row in _rows(home).values()} == {"running"}
            assert identify(supervisor.pid) == supervisor
            assert _rows(home)["world"]["pid"] == pids["world"]
        finally:
            _lfa(home, "down", str(file))
            left = [one for one in own_processes() if str(home) in str(one)]
            for one in left:
                identity.send_signal(one, signal.SIGKILL)
        assert left == []
