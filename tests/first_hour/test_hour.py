"""A new user's first hour, command by command, from a folder with a space in its path; as this user and as nobody."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.first_hour.hour import ALONE, BAD, BY_HAND, RAISES, TEAM, Step
from tests.rigs.lfa_runs import eventually
from tests.test_imports import ROOT

BIN = Path(sys.executable).parent
NOBODY = ("setpriv", "--reuid=65534", "--regid=65534", "--clear-groups")
USERS = ("me", "nobody")


def prefix_of(user: str) -> tuple[str, ...]:
    """Return what runs a command as `user`; skip where that cannot be done."""
    if user == "me":
        return ()
    if os.getuid() != 0 or shutil.which("setpriv") is None:
        pytest.skip("needs root and setpriv")
    if subprocess.run([*NOBODY, str(BIN / "lfa"), "--version"], capture_output=True, cwd="/").returncode != 0:
        pytest.skip("nobody may not read this checkout")
    return NOBODY


def run(step: Step, folder: Path, prefix: tuple[str, ...] = (), **names: str) -> None:
    """Run one command in `folder` and check its exit code and what it says."""
    command = step.command.format(**names) if names else step.command
    name, *words = shlex.split(command)
    there = os.environ | {"TMPDIR": str(folder), "HOME": str(folder), "PYTHONDONTWRITEBYTECODE": "1", "COLUMNS": "120"}
    done = subprocess.run(
        [*prefix, str(BIN / name), *words], cwd=folder, env=there, capture_output=True, text=True, timeout=90
    )
    said = done.stdout + done.stderr
    assert done.returncode == step.code, f"{command}\n{said}"
    assert [text for text in step.says if text not in said] == [], f"{command}\n{said}"
    assert "Traceback" not in said, f"{command}\n{said}"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("hour") / "a first hour"
    made.mkdir()
    code = re.search(r"```python\n(# carrot\.py\n.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    assert code is not None
    (made / "carrot.py").write_text(code[1])
    (made / "bad.py").write_text(RAISES)
    (made / "bad.toml").write_text(BAD)
    return made


def test_each_command_does_and_says_what_a_new_user_expects(folder: Path) -> None:
    """One test: later commands need the folders that earlier ones made."""
    wrong = []
    for step in ALONE:
        try:
            run(step, folder)
        except AssertionError as error:
            wrong.append(str(error))
    assert wrong == [], "\n".join(wrong)


class Hand:
    """A fleet started by hand by one user: each process writes what it says to a file of its own."""

    def __init__(self, folder: Path, prefix: tuple[str, ...], fleet: str) -> None:
        self.folder, self.prefix, self.fleet = folder, prefix, fleet
        self.endpoint = f"unixsock-stream/{folder / 'r.sock'}"
        self._children: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, name: str, command: str) -> None:
        words = shlex.split(command.format(fleet=self.fleet, endpoint=shlex.quote(self.endpoint)))
        with (self.folder / f"{name}.txt").open("ab") as log:
            there = os.environ | {"TMPDIR": str(self.folder), "HOME": str(self.folder)}
            started = [*self.prefix, str(BIN / words[0]), *words[1:]]
            self._children[name] = subprocess.Popen(started, cwd=self.folder, stdout=log, stderr=log, env=there)

    def says(self, name: str, text: str) -> None:
        """Wait until a process has said `text`."""
        path = self.folder / f"{name}.txt"
        eventually(lambda: text in path.read_text(), lambda: f"{name} never says {text!r}: {path.read_text()}")

    def ended(self, name: str, number: signal.Signals) -> int:
        self._children[name].send_signal(number)
        return self._children[name].wait(10.0)

    def kill(self) -> None:
        for child in self._children.values():
            child.kill()
            child.wait()


@pytest.fixture(params=USERS)
def hand(request: pytest.FixtureRequest) -> Iterator[Hand]:
    prefix = prefix_of(request.param)
    with tempfile.TemporaryDirectory(prefix="lfa hour ", dir="/tmp") as place:
        os.chmod(place, 0o777)
        started = Hand(Path(place), prefix, f"hour-{request.param}-{os.getpid()}")
        yield started
        started.kill()


@pytest.mark.processes
def test_a_fleet_by_hand_says_what_it_does_obeys_faults_and_gets_a_report(hand: Hand) -> None:
    hand.start("robot1", f"lfa-agent --role leader --id 1 --faults {TEAM}")
    hand.says("robot1", "waiting for one (start it with: lfa-router)")
    hand.start("router", "lfa-router --listen {endpoint}")
    hand.says("router", ": ready")
    hand.says("robot1", "robot1: ready, in fleet")
    hand.says("robot1", "robot1: waits for the mission, which lfa-world publishes")
    hand.start("world", f"lfa-world straight --robots 3 --seed 5 --faults {TEAM}")
    hand.says("world", "world: ready")
    for robot in (2, 3):
        hand.start(f"robot{robot}", f"lfa-agent --role follower --id {robot} --faults {TEAM}")
    hand.says("robot3", "role=follower")
    for step in BY_HAND:
        run(step, hand.folder, hand.prefix, fleet=hand.fleet)
    hand.start("robot3-again", f"lfa-agent --role follower --id 3 --faults {TEAM}")
    hand.says("robot3-again", "robot3: ready")
    assert hand.ended("robot2", signal.SIGTERM) == 0
    hand.says("robot2", "robot2: ended, by SIGTERM")
    for name in ("robot1", "robot3-again", "world", "router"):
        assert hand.ended(name, signal.SIGINT) == 130
        hand.says(name, "ended, by Ctrl-C")
