"""The death of what all robots share: the router, and the world with its witness."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

from lfa.deploy.analysis.verification.journals import verify
from lfa.deploy.operate.fault import command as fault
from lfa.protocol.errors import Refused
from lfa.world import checkpoint
from tests.rigs.lfa_runs import SHORT, eventually, lfa, running

pytestmark = pytest.mark.processes

DIES_AT_S = 2.0
ON_M = 0.3
"""The team drives again when one of it has come this much further."""


@pytest.mark.parametrize("process", ["router", "world"])
def test_one_that_all_share_dies_and_starts_again_and_the_team_drives_on(tmp_path: Path, process: str) -> None:
    restart = ("--set", f'restart={{{process} = "on-failure"}}', "--fault", f"kill {process} at {DIES_AT_S:g} s")
    with running(tmp_path / "run", "straight", "--robots", "2", *restart) as run:
        run.wait_for("restarted")
        before = checkpoint.read(run.folder)
        far_m = max(robot.pose.x for robot in before.robots) + ON_M
        eventually(lambda: max(r.pose.x for r in checkpoint.read(run.folder).robots) > far_m, "nobody drives on")
        after = checkpoint.read(run.folder)
        run.launcher.send_signal(signal.SIGTERM)
        run.launcher.wait(30.0)
    assert after.step > before.step, "the world's time began anew"
    assert min(r.pose.x for r in after.robots) > min(r.pose.x for r in before.robots) - 0.1, "somebody jumped back"
    lives = len(list((run.folder / "journal").glob("world-*.bin")))
    assert lives == (2 if process == "world" else 1)
    assert verify(run.folder).broken == (), f"reproduce: lfa verify {run.folder}"


def test_without_a_word_about_restarts_the_routers_death_ends_the_run(tmp_path: Path) -> None:
    fault = ("--fault", "kill router at 1 s", "--no-figures")
    done = lfa("run", "straight", *SHORT, *fault, "--robots", "1", "--out", str(tmp_path / "run"))
    assert done.returncode == 1, done.stderr + done.stdout
    assert "aborted" in done.stdout
    assert "router ended (SIGKILL)" in done.stdout


def test_by_hand_the_world_is_stopped_and_killed_and_a_robot_started_again(tmp_path: Path) -> None:
    arguments = ("straight", "--robots", "2", "--set", 'restart={world = "on-failure"}')
    with running(tmp_path / "run", *arguments) as run:
        run.wait_for("leader_command")
        fleet = f"straight-{run.launcher.pid}"
        for action, target in (("stop", "world"), ("continue", "world"), ("kill", "2"), ("restart", "2")):
            assert fault(action, target, fleet=fleet) == 0
        eventually(lambda: len(list((run.folder / "journal").glob("robot2-*.bin"))) == 2, "robot 2 has no second life")
        with pytest.raises(Refused, match="runs already"):
            fault("restart", "2", fleet=fleet)
        assert fault("kill", "world", fleet=fleet) == 0
        run.wait_for("restarted")
        run.launcher.send_signal(signal.SIGTERM)
        run.launcher.wait(30.0)
    told = [(line["deed"], line["robot"]) for line in run.events() if line["kind"] == "fault"]
    assert told == [("stop", "world"), ("continue", "world"), ("kill", 2), ("restart", 2), ("kill", "world")]
    assert not [line for line in run.events() if line["kind"] == "died"]
