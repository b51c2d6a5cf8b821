"""`lfa up` for this machine, as a new user would try it: real processes, supervised, and gone after `lfa down`."""

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

import msgspec
import pytest

from lfa.deploy.fleet.engine.engine import KnownProcess
from lfa.deploy.fleet.host.ledger import GUARDIAN, LEDGER, Ledger, end_orphans, living, watchers
from lfa.deploy.fleet.plan import host_plan
from lfa.deploy.process import identity
from lfa.deploy.process.identity import Identity, identify, own_processes
from tests.rigs.lfa_runs import LFA, eventually

pytestmark = pytest.mark.processes

FLEET = f"local-{os.getpid()}"
TEXT = f"""
fleet = "{FLEET}"
scenario = "straight"
team = 2
hosts.laptop.address = "localhost"
restart = {{ delay_s = 0.1, watchdog_s = 2.0 }}
"""


class Home:
    """A new user's home with a fleet file in it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.file = folder / "fleet.toml"
        self.file.write_text(TEXT)
        self.state = folder / ".local/state/lfa" / FLEET / "laptop"

    @property
    def environment(self) -> dict[str, str]:
        return {**os.environ, "HOME": str(self.folder)}

    def lfa(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        command = [*LFA, *arguments]
        return subprocess.run(command, capture_output=True, text=True, timeout=90, check=False, env=self.environment)

    def rows(self) -> dict[str, dict[str, Any]]:
        told = self.lfa("ps", "--json", "--fleet", FLEET)
        return {row["process"]: row for row in json.loads(told.stdout)["processes"]}

    def processes(self) -> list[Identity]:
        mark = str(self.state)
        return [one for one in own_processes() if any(mark in word for word in one.arguments)]

    def process(self, module: str, *words: str) -> Identity:
        return next(one for one in self.processes() if module in one.arguments and set(words) <= set(one.arguments))


def _of(home: Home, robot: str) -> list[Identity]:
    return [one for one in home.processes() if "--id" in one.arguments and robot in one.arguments]


@pytest.fixture(scope="module")
def home() -> Iterator[Home]:
    folder = Path(tempfile.mkdtemp(prefix="lfa-", dir="/tmp"))
    made = Home(folder)
    try:
        yield made
    finally:
        for one in made.processes():
            identity.send_signal(one, signal.SIGKILL)
        shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture
def up(home: Home) -> Home:
    """Up, however it was before."""
    done = home.lfa("up", str(home.file), "--json")
    assert done.returncode == 0, done.stderr
    assert set(json.loads(done.stdout)["chain"]) == {1, 2}
    return home


def test_ps_and_logs_need_no_file_where_the_fleet_runs(up: Home) -> None:
    rows = up.rows()
    assert set(rows) == {"router", "world", "robot1", "robot2"}
    assert {row["state"] for row in rows.values()} == {"running"}
    told = up.lfa("logs", "router", "--fleet", FLEET)
    assert told.returncode == 0 and "router listens at" in told.stdout


def test_logs_go_on_with_what_comes_until_ctrl_c(up: Home) -> None:
    told = up.folder / "told"
    log = max(up.state.glob("*/logs/router.log"))
    command = [*LFA, "logs", "-f", "router", "--fleet", FLEET, "-n", "1"]
    with told.open("w") as out, subprocess.Popen(command, stdout=out, text=True, env=up.environment) as following:
        try:
            eventually(lambda: "router listens at" in told.read_text(), "the last line does not come")
            with log.open("a") as file:
                file.write("and more\n")
            eventually(lambda: told.read_text().endswith("and more\n"), "what is written does not come")
            following.send_signal(signal.SIGINT)
            assert following.wait(20.0) == 130
        finally:
            following.kill()


def test_what_is_killed_is_started_again_and_ps_tells_why_it_ended(up: Home) -> None:
    robot = up.process("lfa.agents.cli", "2")
    assert identity.send_signal(robot, signal.SIGKILL)
    eventually(
        lambda: any("lfa.agents.cli" in one.arguments and one != robot for one in _of(up, "2")), "not started again"
    )
    row = up.rows()["robot2"]
    assert row["starts"] > 1
    assert row["ended"] == "robot2 ended (SIGKILL)"


def test_restart_ends_one_process_and_starts_it_again(up: Home) -> None:
    before = up.rows()
    done = up.lfa("restart", "1", "--fleet", FLEET, "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["restarted"] is True
    after = up.rows()
    assert after["robot1"]["pid"] != before["robot1"]["pid"]
    assert after["world"]["pid"] == before["world"]["pid"]


def test_a_process_that_is_not_there_is_refused_with_those_that_are(up: Home) -> None:
    done = up.lfa("restart", "9", "--fleet", FLEET)
    assert done.returncode == 2
    assert (
        done.stderr.strip() == "lfa: robot9: no host that is heard has it: must be one of robot1, robot2, router, world"
    )


def test_up_again_starts_nothing_and_another_file_is_refused(up: Home) -> None:
    pids = {name: row["pid"] for name, row in up.rows().items()}
    assert up.lfa("up", str(up.file)).returncode == 0
    assert {name: row["pid"] for name, row in up.rows().items()} == pids
    other = up.folder / "other.toml"
    other.write_text(TEXT.replace("team = 2", "team = 3"))
    done = up.lfa("up", str(other))
    assert done.returncode == 2
    assert "runs fleet" in done.stderr and "lfa down first" in done.stderr
    assert {name: row["pid"] for name, row in up.rows().items()} == pids


def test_a_killed_supervisor_comes_back_and_adopts_its_processes_which_drive_on(up: Home) -> None:
    before = {name: row["pid"] for name, row in up.rows().items()}
    starts = {name: row["starts"] for name, row in up.rows().items()}
    book = living(up.state)
    assert book is not None and identity.send_signal(book.supervisor, signal.SIGKILL)
    eventually(lambda: _is_back(up, book.supervisor), "the supervisor does not come back")
    after = up.rows()
    assert {name: row["pid"] for name, row in after.items()} == before, "none was started anew"
    assert {name: row["starts"] for name, row in after.items()} == starts
    robot = up.process("lfa.agents.cli", "2")
    assert identity.send_signal(robot, signal.SIGKILL)
    eventually(lambda: any(one != robot for one in _of(up, "2")), "what it adopted is not watched")


def test_a_killed_guardian_comes_back_and_guards_again(up: Home) -> None:
    guardian = up.process("lfa.deploy.fleet.host.guardian")
    assert identity.send_signal(guardian, signal.SIGKILL)
    eventually(lambda: _other_guardian(up, guardian), "the guardian does not come back")
    book = living(up.state)
    assert book is not None and identity.send_signal(book.supervisor, signal.SIGKILL)
    eventually(lambda: _is_back(up, book.supervisor), "the new guardian does not guard")


def test_a_hung_robot_is_killed_within_the_watchdogs_time_and_rejoins(up: Home) -> None:
    hung = up.process("lfa.agents.cli", "2")
    assert identity.send_signal(hung, signal.SIGSTOP)
    eventually(lambda: any(one != hung for one in _of(up, "2")), "what hangs is not restarted")
    row = up.rows()["robot2"]
    assert row["ended"] == "robot2 hung: no sign of life for 2 s; killed"
    done = up.lfa("up", str(up.file), "--json")
    assert (done.returncode, set(json.loads(done.stdout)["chain"])) == (0, {1, 2}), "it is in the chain again"


@pytest.mark.parametrize("module", ["supervisor", "guardian"])
def test_a_watcher_that_hangs_is_replaced_by_the_other_one(up: Home, module: str) -> None:
    eventually(lambda: living(up.state) is not None, "no supervisor runs")
    eventually(lambda: _other_guardian(up, None), "no guardian runs")
    hung = up.process(f"lfa.deploy.fleet.host.{module}")
    pids = {name: row["pid"] for name, row in up.rows().items()}
    assert identity.send_signal(hung, signal.SIGSTOP)
    eventually(lambda: identify(hung.pid) != hung, f"a hung {module} is not ended")
    eventually(lambda: living(up.state) is not None and _other_guardian(up, None), f"no {module} comes back")
    assert {name: row["pid"] for name, row in up.rows().items()} == pids


def _is_back(home: Home, before: Identity) -> bool:
    book = living(home.state)
    return book is not None and book.supervisor != before


def _other_guardian(home: Home, before: Identity | None) -> bool:
    return any(one != before for one in watchers(home.state, GUARDIAN))


def test_orphans_of_an_earlier_life_are_ended_and_nobody_else(up: Home) -> None:
    """The ledger names a process that has gone on without its supervisor, and a number that is somebody else's now."""
    up.lfa("down", str(up.file))
    part = host_plan.read(up.state / host_plan.PART)
    orphan, stranger = (subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"]) for _ in range(2))
    try:
        lost, other = identify(orphan.pid), identify(stranger.pid)
        assert lost is not None and other is not None
        dead = Identity(2**22 - 1, 1, os.getuid(), ("gone",))
        elsewhere = Identity(other.pid, other.started - 1, other.user, other.arguments)
        known = tuple(KnownProcess(f"robot{n}", one, 1, 0) for n, one in enumerate((lost, elsewhere)))
        (up.state / LEDGER).write_bytes(msgspec.json.encode(Ledger(part.run, part.digest, dead, known)))
        assert len(end_orphans(up.state)) == 1
        assert orphan.wait(10.0) == -signal.SIGKILL
        assert stranger.poll() is None
    finally:
        for child in (orphan, stranger):
            child.kill()
            child.wait()


def test_down_needs_no_router(up: Home) -> None:
    """Stopped, it answers nobody: the supervisor hears a signal instead."""
    everybody = up.processes()
    assert identity.send_signal(up.process("lfa.deploy.fleet.host.router"), signal.SIGSTOP)
    done = up.lfa("down", "--fleet", FLEET)
    assert done.returncode == 0, done.stderr
    assert [one for one in everybody if identify(one.pid) == one] == []
    assert list(up.state.glob("*.sock*")) == []


def test_down_of_what_does_not_run_ends_nothing(home: Home) -> None:
    home.lfa("down", str(home.file))
    done = home.lfa("down", str(home.file), "--json")
    assert done.returncode == 0
    assert json.loads(done.stdout)["ended"] == []


def test_without_a_fleet_here_the_line_says_what_to_give(home: Home) -> None:
    done = home.lfa("ps", "--fleet", "nobody")
    assert done.returncode == 2
    assert done.stderr.strip().startswith("lfa: no fleet 'nobody' has a supervisor here: give its fleet file")
