"""`lfa up` with systemd as its engine, from start to `lfa down`.

systemd is a stand-in here (`tests/rigs/standin_systemctl.py`): PID 1 of a container is none.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from lfa.deploy.fleet.engine.units import units
from lfa.deploy.fleet.host.ledger import SUPERVISOR, watchers
from lfa.deploy.fleet.plan.host_plan import PART, read
from lfa.deploy.process.identity import identify, own_processes, send_signal
from lfa.deploy.process.process_group import ProcessSpec
from lfa.deploy.process.restart_policy import Restart
from tests.rigs.lfa_runs import LFA, eventually

FLEET = f"units-{os.getpid()}"
TEXT = f"""
fleet = "{FLEET}"
scenario = "straight"
team = 2
engine = "systemd"
hosts.here.address = "localhost"
restart = {{ delay_s = 0.1 }}
"""


class StandIn:
    """A user's home on a machine whose systemd is the stand-in."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.file = folder / "fleet.toml"
        self.file.write_text(TEXT)
        self.state = folder / ".local/state/lfa" / FLEET / "here"
        self.units = folder / ".config/systemd/user"
        source = (Path(__file__).parents[2] / "rigs" / "standin_systemctl.py").read_text()
        for name in ("systemctl", "journalctl", "loginctl"):
            script = folder / "bin" / name
            script.parent.mkdir(exist_ok=True)
            script.write_text(f"#!{sys.executable}\n{source}")
            script.chmod(0o700)

    def lfa(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return self._run(*LFA, *arguments)

    def systemctl(self, *words: str) -> subprocess.CompletedProcess[str]:
        return self._run("systemctl", "--user", *words)

    def _run(self, *command: str) -> subprocess.CompletedProcess[str]:
        path = f"{self.folder / 'bin'}:{os.environ['PATH']}"
        around = {**os.environ, "HOME": str(self.folder), "PATH": path}
        command = (shutil.which(command[0], path=path) or command[0], *command[1:])
        return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, env=around)

    def rows(self) -> dict[str, dict[str, Any]]:
        told = self.lfa("ps", "--json", "--fleet", FLEET)
        return {row["process"]: row for row in json.loads(told.stdout)["processes"]} if told.returncode == 0 else {}

    def left(self) -> list[str]:
        mark = str(self.folder)
        return [" ".join(one.arguments) for one in own_processes() if any(mark in word for word in one.arguments)]


@pytest.fixture
def home() -> Iterator[StandIn]:
    folder = Path(tempfile.mkdtemp(prefix="lfa-", dir="/tmp"))
    made = StandIn(folder)
    try:
        yield made
    finally:
        for one in own_processes():
            if any(str(folder) in word for word in one.arguments):
                send_signal(one, signal.SIGKILL)
        shutil.rmtree(folder, ignore_errors=True)


@pytest.mark.processes
def test_up_restart_logs_and_down_go_by_systemd(home: StandIn) -> None:
    done = home.lfa("up", str(home.file), "--boot", "--json")
    assert done.returncode == 0, done.stderr
    assert "lingering is now on" in done.stderr
    rows = home.rows()
    assert {name: row["state"] for name, row in rows.items()} == dict.fromkeys(rows, "running")
    assert set(rows) == {"router", "world", "robot1", "robot2"}
    assert "router listens at" in home.lfa("logs", "router", "--fleet", FLEET).stdout

    again = home.lfa("restart", "1", "--fleet", FLEET, "--json")
    assert json.loads(again.stdout)["restarted"] is True
    robot = identify(home.rows()["robot2"]["pid"])
    assert robot is not None and send_signal(robot, signal.SIGKILL)
    eventually(lambda: home.rows().get("robot2", {}).get("starts", 1) > 1, "systemd does not start it again")

    pids = {name: row["pid"] for name, row in home.rows().items()}
    (supervisor,) = watchers(home.state, SUPERVISOR)
    assert send_signal(supervisor, signal.SIGKILL)
    home.systemctl("show")  # a look at the units, at which the stand-in restarts what ended
    eventually(lambda: {name: row["pid"] for name, row in home.rows().items()} == pids, "others ended with it")

    down = home.lfa("down", "--fleet", FLEET)
    assert down.returncode == 0, down.stderr
    assert (home.left(), list(home.units.iterdir())) == ([], [])


@pytest.mark.processes
def test_e35_an_upgrade_leaves_the_processes_to_systemd_and_to_the_boot(home: StandIn) -> None:
    """The two hosts are one machine, and the units of one begin like the other's."""
    second = 'hosts.here-2 = { address = "127.0.0.1", router_port = 7653 }\nrobots.on = { 1 = "here-2", 2 = "here" }\n'
    home.file.write_text(TEXT.replace('engine = "systemd"\n', "") + second)
    up = home.lfa("up", str(home.file), "--boot")
    assert up.returncode == 0, up.stderr
    before, units_before = home.rows(), sorted(home.units.iterdir())
    done = home.lfa("upgrade", str(home.file), "--json")
    assert (done.returncode, json.loads(done.stdout)["upgraded"]) == (0, ["here", "here-2"]), done.stderr
    after = home.rows()
    assert {row["state"] for row in after.values()} == {"running"}
    assert before.keys() == after.keys() and {row["pid"] for row in before.values()}.isdisjoint(
        row["pid"] for row in after.values()
    )
    assert sorted(home.units.iterdir()) == units_before
    part = read(home.state / PART)
    assert (part.engine, part.boot) == ("systemd", True)


def test_a_machine_without_systemd_is_refused_before_anything_starts(home: StandIn) -> None:
    (home.folder / "bin" / "systemctl").write_text("#!/bin/sh\necho 'Failed to connect to bus' >&2; exit 1\n")
    done = home.lfa("up", str(home.file))
    assert (done.returncode, home.left()) == (2, [])
    assert "Failed to connect to bus" in done.stderr


@pytest.mark.parametrize(
    ("line", "right"),
    [('engine = "systemd"', "boot = true"), ('engine = "cron"', "")],
)
def test_a_file_that_no_engine_fits_is_refused(home: StandIn, line: str, right: str) -> None:
    home.file.write_text(TEXT.replace('engine = "systemd"', right or line))
    done = home.lfa("validate", str(home.file))
    assert done.returncode == 2
    assert "boot = true: must be false" in done.stderr or "engine" in done.stderr


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="needs systemd-analyze")
@pytest.mark.parametrize("scope", ["user", "system"])
def test_systemd_takes_the_units(tmp_path: Path, scope: str) -> None:
    rows = [ProcessSpec(name, ("a.module", "--path", "a b 50%")) for name in ("router", "robot1", "supervisor")]
    made = units("f", "here", rows, Restart(), tmp_path, sys.executable, "user" if scope == "user" else "system")
    for name, text in made.items():
        (tmp_path / name).write_text(text)
    paths = sorted(str(tmp_path / name) for name in made)
    whose = ["--user"] if scope == "user" else []
    verify = ["systemd-analyze", *whose, "verify", "--man=no", "--recursive-errors=no", *paths]
    around = {**os.environ, "XDG_RUNTIME_DIR": str(tmp_path)}
    done = subprocess.run(verify, capture_output=True, text=True, timeout=60, check=False, env=around)
    assert (done.returncode, done.stderr) == (0, "")
