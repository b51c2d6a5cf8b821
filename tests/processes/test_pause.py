"""Everything but the recorder stands still for a second: what the run's summary tells is still the truth."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from lfa.deploy.recording import mcap_reader
from lfa.protocol import clock
from tests.rigs.lfa_runs import running

pytestmark = pytest.mark.processes

PAUSE_S = 1.0
"""As long as a link lives without a sign of life: some links break, and some do not."""
END_S_MAX = 120.0


def test_after_a_pause_of_all_but_the_recorder_the_summary_names_who_led_and_how_it_ended(tmp_path: Path) -> None:
    with running(tmp_path / "run", "straight", "--robots", "3") as run:
        run.wait_for("leader_command")
        paused = [identity.pid for name, identity in run.group().items() if name != "recorder"] + [run.launcher.pid]
        for pid in paused:
            os.kill(pid, signal.SIGSTOP)
        clock.sleep(PAUSE_S)
        for pid in paused:
            os.kill(pid, signal.SIGCONT)
        code = run.launcher.wait(END_S_MAX)
        summary = run.summary()
    recording = summary["recording"]
    print(f"exit {code}, {summary['outcome']}, {recording['missing']} messages missing, led: {summary['leaders']}")
    commands = mcap_reader.read(run.folder).cmd_vel
    led_until = {robot: max(row[0] for row in rows if row[3]) for robot, rows in commands.items() if rows[:, 3].any()}
    assert summary["outcome"] == "goal_reached" and code == 0
    assert summary["leaders"][-1]["robot_id"] == max(led_until, key=lambda robot: led_until[robot])
    assert bool(summary["warnings"]) == bool(recording["holes"])
