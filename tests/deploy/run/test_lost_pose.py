"""A robot without a pose neither leads nor holds others up: it stands, says so, and is left behind."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfa.deploy.analysis.run_data import Run
from lfa.deploy.analysis.summary import Summary
from lfa.deploy.faults.script import parse_all
from lfa.deploy.run.simulate import run
from lfa.world.description.load import load

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
