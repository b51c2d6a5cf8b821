"""`lfa run --lockstep` on real processes: the run of `lfa sim`, up to what nobody could foresee."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from lfa.deploy.lockstep.diff_command import compare
from lfa.deploy.process.identity import identify
from tests.rigs.lfa_runs import SHORT, lfa, running

pytestmark = pytest.mark.processes

SEED = ("--seed", "7", *SHORT)
TICKS = 50


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("simulated") / "run"
    done = lfa("sim", "straight", *SEED, "--out", str(folder))
    assert done.returncode == 0, done.stderr
    return folder


def test_processes_in_lockstep_make_the_run_of_the_simulation(simulated: Path, tmp_path: Path) -> None:
    done = lfa("run", "straight", "--lockstep", *SEED, "--no-figures", "--out", str(tmp_path / "run"))
    assert done.returncode == 0, done.stdout + done.stderr
    found = lfa("diff", str(simulated), str(tmp_path / "run"))
    assert found.returncode == 0, f"lfa run straight --lockstep {' '.join(SEED)}: {found.stdout}{found.stderr}"
    assert (tmp_path / "run" / "events.jsonl").read_bytes() == (simulated / "events.jsonl").read_bytes()


def test_a_run_that_stands_goes_on_by_lfa_step_without_the_robots_that_never_answer(
    simulated: Path, tmp_path: Path
) -> None:
    with running(tmp_path / "run", "straight", "--lockstep", "--step", str(TICKS), *SEED) as run:
        assert run.launcher.stderr is not None
        assert any(line.startswith(f"stands at tick {TICKS} ") for line in run.launcher.stderr)
        os.kill(run.group()["robot3"].pid, signal.SIGKILL)
        os.kill(run.group()["robot4"].pid, signal.SIGSTOP)
        where = ("--connect", _endpoint(run.group()["robot1"].arguments))
        done = lfa("step", "10", *where)
        assert done.returncode == 0, done.stdout + done.stderr
        assert done.stdout == f"stands at tick {TICKS + 10} ({0.02 * (TICKS + 10):.3f} s)\n"
        run.launcher.send_signal(signal.SIGTERM)
        _, stderr = run.launcher.communicate(timeout=30.0)
        left = [name for name, identity in run.group().items() if identify(identity.pid) == identity]
    found = compare(run.folder, simulated)
    assert found.tick is not None and found.tick >= TICKS, "deterministic up to the kill"
    assert "robot3 ended (SIGKILL)" in stderr
    assert "robot4 has not answered for 5 s: it counts as killed" in stderr
    assert left == []
    assert not Path(where[1].removeprefix("unixsock-stream/")).parent.exists()


def _endpoint(arguments: tuple[str, ...]) -> str:
    return arguments[arguments.index("--connect") + 1]
