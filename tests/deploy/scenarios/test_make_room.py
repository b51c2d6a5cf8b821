"""A team in a dead end in which no robot passes another one: it comes out backwards, as the leader has to pass."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfa.deploy.bench.driving.one_run import loaded
from lfa.deploy.recording import event_log
from lfa.deploy.run.simulate import run

DEAD_END = """title = "A corridor of 0.7 m with a bend and an end"
time_limit_s = 150
[mission]
robots = [1, 2, 3]
control_hz = 25
[mission.formation]
separation_m = 0.8
side = "column"
[mission.following]
trace = true
[mission.leading]
motion = "explore"
route_m = [[0.5, 1.5]]
cruise_mps = 0.4
[world]
start = [4.6, 0.0, 0.0]
walls_m = [[3.0, 0.34, 5.3, 0.34], [3.0, -0.34, 6.0, -0.34], [6.0, -0.34, 6.0, 3.0], [5.3, 0.34, 5.3, 3.0],
           [5.3, 3.0, 6.0, 3.0], [3.0, 0.34, 3.0, 5.0], [3.0, -0.34, 3.0, -5.0], [-3.0, -5.0, 3.0, -5.0],
           [-3.0, 5.0, -3.0, -5.0]]
[world.lidar]
beams = 60
[world.noise]
localization_m = 0.005
localization_rad = 0.0087
odometry = 0.01
range_m = 0.005
range_dropout = 0.002
"""


def comes_out(seed: int, folder: Path) -> set[object]:
    """Return what the robots of the team did on its way out."""
    done = run(loaded("dead_end_0.7", DEAD_END), seed, folder / "run")
    contacts = sum(robot.contacts for robot in done.summary.robots)
    where = f"reproduce: lfa sim {folder / 'run' / 'scenario.toml'} --seed {seed}"
    assert (done.summary.outcome, done.summary.left_behind, contacts) == ("goal_reached", [], 0), where
    return {event.get("action") for event in event_log.of_kind(event_log.lines(done.folder), "decision")}


def test_followers_make_room_for_a_leader_that_comes_back(tmp_path: Path) -> None:
    assert "make_room" in comes_out(2, tmp_path)


@pytest.mark.campaign
@pytest.mark.parametrize("seed", [1, 3, 4, 5, 6, 7, 8, 9, 10, 17, 25, 26])
def test_the_team_comes_out_with_other_seeds(seed: int, tmp_path: Path) -> None:
    comes_out(seed, tmp_path)
