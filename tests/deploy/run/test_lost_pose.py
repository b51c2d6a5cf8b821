"""A robot without a pose neither leads nor holds others up: it stands, says so, and is left behind."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from lfa.deploy.analysis.run_data import Run
from lfa.deploy.analysis.summary import Summary
from lfa.deploy.faults.script import parse_all
from lfa.deploy.recording.mcap_reader import messages
from lfa.deploy.run.simulate import run
from lfa.protocol.lease.timing import timing_of
from lfa.world.description.load import load
from lfa.world.robot_hardware import RobotHardware

SETTINGS = ("mission.leading.route_m=[[6.0, 0.0]]", "faults=[]", "time_limit_s=60.0", "world.lidar.beams=60")
REPRODUCE = "lfa sim straight --robots 3 --seed 1 --set mission.leading.route_m=[[6.0,0.0]] --fault"


def driven(folder: Path, *faults: str) -> tuple[Run, Summary]:
    scenario = load("straight", SETTINGS, 3)
    ended = run(scenario, 1, folder, parse_all(scenario.mission, (), faults))
    return Run(ended.folder), ended.summary


@pytest.mark.parametrize("robot", [1, 2, 3])
@pytest.mark.parametrize("part", ["localization", "driver"])
def test_a_robot_that_never_has_a_pose_is_left_behind_and_the_others_arrive(
    part: str, robot: int, tmp_path: Path
) -> None:
    fault = f"hang {part} {robot} at 0 s"
    done, summary = driven(tmp_path / "run", fault)
    assert (summary.outcome, summary.left_behind) == ("goal_reached", [robot]), f"{REPRODUCE} '{fault}'"
    stuck = [line["reason"] for line in done.events if line["kind"] == "stuck" and line["robot"] == robot]
    assert stuck[0].startswith("S6: own pose lost")


@pytest.mark.parametrize("robot", [1, 2])
def test_e25_a_robot_whose_gateway_holds_other_durations_stands_says_so_and_is_left_behind(
    robot: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As with a driver that was started for the profile `wifi` in a team of `std`."""
    ordinary = RobotHardware.__init__

    def other(self: RobotHardware, *arguments: Any) -> None:
        ordinary(self, *arguments)
        if self.id == robot:
            self.gateway.grant_s = timing_of("wifi").grant_s

    monkeypatch.setattr(RobotHardware, "__init__", other)
    done, summary = driven(tmp_path / "run")
    assert (summary.outcome, summary.left_behind) == ("goal_reached", [robot])
    said = [line for line in done.events if line["kind"] == "gateway"]
    assert [(line["robot"], line["grant_s"], line["must_be_s"]) for line in said] == [(robot, 1.003, 0.301)]
    assert abs(done.truth[robot][:, 4]).max() < 1e-3
    told = messages(done.folder, frozenset({"status"}))
    texts = {status.text for owner, _, _, status in told if owner == f"robot{robot}"}
    assert "its gateway holds T_grant = 1.003 s: must be 0.301 s, as in the mission" in texts


@pytest.mark.parametrize("robot", [1, 2])
def test_a_localization_that_ends_stands_its_robot_and_frees_the_chain(robot: int, tmp_path: Path) -> None:
    fault = f"hang localization {robot} at 5 s"
    done, summary = driven(tmp_path / "run", fault)
    assert (summary.outcome, summary.left_behind) == ("goal_reached", [robot]), f"{REPRODUCE} '{fault}'"
    truth = done.truth[robot]
    after = truth[truth[:, 0] > 16.0]
    assert abs(after[:, 4]).max() < 1e-3
    lost = [line["t"] for line in done.events if line["kind"] == "input" and line.get("input") == "localization"]
    assert 5.0 < min(lost) < 9.0, f"{REPRODUCE} '{fault}'"


def test_a_localization_that_comes_back_brings_its_robot_back_into_the_chain(tmp_path: Path) -> None:
    fault = "hang localization 2 at 4 s for 8 s"
    _, summary = driven(tmp_path / "run", fault)
    assert (summary.outcome, summary.left_behind) == ("goal_reached", []), f"{REPRODUCE} '{fault}'"


def test_a_robot_whose_driver_hung_drives_on_and_publishes_no_pose(tmp_path: Path) -> None:
    fault = "hang driver 2 at 5 s for 4 s"
    done, _ = driven(tmp_path / "run", fault)
    truth = done.truth[2]
    during = truth[(truth[:, 0] > 5.5) & (truth[:, 0] < 8.5)]
    assert during[:, 4].min() > 0.3, f"{REPRODUCE} '{fault}'"
