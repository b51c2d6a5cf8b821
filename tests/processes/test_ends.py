"""However a run ends, within five seconds nothing of it is left, and its folder can be read."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from lfa.deploy.recording import mcap_reader
from tests.rigs.lfa_runs import Running, eventually, running

pytestmark = pytest.mark.processes

LEFT_S_MAX = 5.0
"""On a machine with nothing else to do."""


def patience_s() -> float:
    """So much longer as there is more to do than the machine has cores."""
    return LEFT_S_MAX * max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))


def assert_nothing_is_left(run: Running) -> None:
    eventually(lambda: run.left() == [], lambda: f"still there: {run.left()}", patience_s())
    assert mcap_reader.read(run.folder).end_s > 0.0, "the recording gives no ground truth"
    assert list((run.folder / "journal").glob("robot1-*.bin")), "robot 1 left no journal"


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_all_and_the_exit_code_says_which(tmp_path: Path, number: int, code: int) -> None:
    with running(tmp_path / "run", "straight") as run:
        run.wait_for("leader_command")
        run.launcher.send_signal(number)
        assert run.launcher.wait(patience_s()) == code
        assert_nothing_is_left(run)
        assert run.summary()["outcome"] == "interrupted"


@pytest.mark.parametrize("victim", ["router", "world"])
def test_without_router_or_world_a_run_is_aborted(tmp_path: Path, victim: str) -> None:
    with running(tmp_path / "run", "straight") as run:
        run.wait_for("leader_command")
        os.kill(run.group()[victim].pid, signal.SIGKILL)
        assert run.launcher.wait(patience_s()) == 1
        assert_nothing_is_left(run)
        assert run.summary()["outcome"] == "aborted"
        assert run.summary()["reason"] == f"{victim} ended (SIGKILL)"


def test_a_killed_launcher_takes_all_with_it_also_what_is_stopped(tmp_path: Path) -> None:
    with running(tmp_path / "run", "straight") as run:
        run.wait_for("leader_command")
        for name in ("robot2", "recorder"):
            os.kill(run.group()[name].pid, signal.SIGSTOP)
        run.launcher.kill()
        run.launcher.wait()
        assert_nothing_is_left(run)
        assert run.summary()["outcome"] == "aborted"
        assert run.summary()["reason"] == "the launcher died"


def test_a_killed_recorder_aborts_the_run_and_leaves_all_but_its_last_second(tmp_path: Path) -> None:
    with running(tmp_path / "run", "straight") as run:
        run.wait_for("leader_command")
        eventually(lambda: mcap_reader.read(run.folder).end_s > 1.0, "no whole second was written")
        os.kill(run.group()["recorder"].pid, signal.SIGKILL)
        assert run.launcher.wait(patience_s()) == 1
        assert_nothing_is_left(run)
        assert run.summary()["reason"] == "recorder ended (SIGKILL)"
