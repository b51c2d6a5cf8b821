"""Both engines do the same for a supervisor: start, restart, states, logs, stop.

systemd is a stand-in here (`tests/rigs/standin_systemctl.py`) unless PID 1 is systemd with a manager for this user.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from lfa.deploy.fleet.engine.engine import ProcessEngine
from lfa.deploy.fleet.engine.own import OwnEngine
from lfa.deploy.fleet.engine.systemd import SystemdEngine, unit_folder
from lfa.deploy.fleet.engine.units import units
from lfa.deploy.process.process_group import ProcessSpec
from lfa.deploy.process.restart_policy import Restart
from lfa.protocol import clock
from lfa.protocol.messages.fleet import ProcessReport
from tests.rigs.lfa_runs import eventually

pytestmark = pytest.mark.processes

RESTART = Restart(delay_s=0.0, watchdog_s=60.0)
PROGRAM = """
import pathlib, signal, sys, time
signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
print("begins", flush=True)
order = pathlib.Path(sys.argv[1])
while not order.exists():
    time.sleep(0.02)
sys.exit(int(order.read_text() or "0"))
"""


class Rig:
    """An engine with a router and two robots that wait for a file with their exit code."""

    def __init__(self, engine: ProcessEngine, folder: Path, logs: Path) -> None:
        self.engine = engine
        self.folder = folder
        self.logs = logs

    def report(self, name: str) -> ProcessReport:
        self.engine.step(clock.now() + 100.0 if isinstance(self.engine, SystemdEngine) else clock.now(), router_up=True)
        if isinstance(self.engine, SystemdEngine):
            self.engine._look_at = 0.0
        return next(one for one in self.engine.states(clock.now()) if one.name == name)

    def await_state(self, name: str, state: str, starts: int = 1) -> ProcessReport:
        def there() -> bool:
            one = self.report(name)
            return one.state == state and one.starts >= starts

        eventually(there, lambda: f"{name} is not {state}: {self.report(name)}")
        return self.report(name)

    def order(self, name: str, code: int) -> None:
        (self.folder / f"{name}.order").write_text(str(code))


def specs(folder: Path) -> list[ProcessSpec]:
    (folder / "waiter.py").write_text(PROGRAM)
    return [ProcessSpec(name, ("waiter", str(folder / f"{name}.order"))) for name in ("router", "robot1", "robot2")]


@pytest.fixture(params=["own", "systemd"])
def rig(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Rig]:
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    rows = specs(tmp_path)
    engine: ProcessEngine
    if request.param == "own":
        (tmp_path / "run").mkdir()
        engine = OwnEngine(rows, RESTART, tmp_path, tmp_path / "run", None)
    else:
        _stand_in(tmp_path, monkeypatch)
        made = units("test", "here", rows, RESTART, tmp_path, sys.executable, "user")
        unit_folder("user").mkdir(parents=True)
        for name, text in made.items():
            (unit_folder("user") / name).write_text(text.replace(" -P ", " "))
        engine = SystemdEngine("test", "here", [row.name for row in rows], "user")
    made_rig = Rig(engine, tmp_path, tmp_path)
    engine.start(clock.now())
    try:
        yield made_rig
    finally:
        engine.stop(clock.now(), router=False)
        engine.stop(clock.now(), router=True)
        engine.close()


def _stand_in(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Put the stand-ins before the real programs, and the home into a folder of the test."""
    source = Path(__file__).parents[3] / "rigs" / "standin_systemctl.py"
    for name in ("systemctl", "journalctl"):
        script = folder / "bin" / name
        script.parent.mkdir(exist_ok=True)
        script.write_text(f"#!{sys.executable}\n{source.read_text()}")
        script.chmod(0o700)
    monkeypatch.setenv("HOME", str(folder))
    monkeypatch.setenv("PATH", f"{folder / 'bin'}{os.pathsep}{os.environ['PATH']}")


def test_all_run_once_started_and_none_is_left_once_stopped(rig: Rig) -> None:
    pids = [rig.await_state(name, "running").pid for name in ("router", "robot1", "robot2")]
    assert len({one.identity.pid for one in rig.engine.known()} & set(pids)) == 3
    rig.engine.stop(clock.now(), router=False)
    assert [rig.report(name).pid for name in ("robot1", "robot2")] == [0, 0]
    assert rig.report("router").pid == pids[0], "the router ends last"


def test_what_is_killed_is_started_again_and_counted(rig: Rig) -> None:
    before = rig.await_state("robot1", "running")
    os.kill(before.pid, signal.SIGKILL)
    after = rig.await_state("robot1", "running", starts=2)
    assert after.pid != before.pid


def test_a_restart_ends_one_process_and_starts_it_again(rig: Rig) -> None:
    before = rig.await_state("robot2", "running")
    other = rig.await_state("robot1", "running")
    rig.engine.restart("robot2", clock.now())
    assert rig.await_state("robot2", "running", starts=2).pid != before.pid
    assert rig.report("robot1").pid == other.pid


@pytest.mark.parametrize(("code", "state"), [(0, "ended"), (2, "refused")])
def test_what_ended_in_order_or_was_refused_is_not_started_again(rig: Rig, code: int, state: str) -> None:
    rig.await_state("robot1", "running")
    rig.order("robot1", code)
    assert rig.await_state("robot1", state).pid == 0


def test_the_logs_have_the_last_lines_and_then_the_new_ones(rig: Rig) -> None:
    rig.await_state("robot1", "running")
    lines: list[str] = []
    eventually(lambda: "begins" in rig.engine.logs("robot1", 5, clock.now()).take(clock.now()), "no first line")
    tail = rig.engine.logs("robot1", 0, clock.now())
    rig.engine.restart("robot1", clock.now())
    rig.await_state("robot1", "running", starts=2)
    eventually(lambda: bool(lines.extend(tail.take(clock.now())) or lines), "no new line")
    assert lines == ["begins"]
