"""`lfa bench motion`: what counts as a good run, and pairs of start and goal that a team can be laid out at."""

from __future__ import annotations

from math import hypot
from pathlib import Path

import pytest

from deploy.bench import motion
from deploy.run.simulate import run
from world.scenario import load, shipped


def test_every_shipped_scenario_is_a_case() -> None:
    names = {case.name for case in motion.cases(1)}
    assert {f"scenario/{name}" for name in shipped()} <= names


def test_a_pair_is_far_apart_and_has_room_for_the_team() -> None:
    [sets] = motion.pairs(1)
    scenario = load("explore", sets)
    assert scenario.world.starts is not None
    (x, y, _), goal = scenario.world.starts[0], scenario.mission.goal_m
    assert hypot(x - goal[0], y - goal[1]) > motion.PAIR_M - 0.02


@pytest.mark.parametrize(("goal", "limit", "good"), [(1.0, 30.0, True), (5.0, 1.0, False)])
def test_a_run_that_does_not_end_at_its_goal_is_not_good(tmp_path: Path, goal: float, limit: float, good: bool) -> None:
    sets = [f"mission.leading.route_m=[[{goal}, 0.0]]", f"time_limit_s={limit}"]
    wrong = motion.complaint(run(load("straight", sets, 2), 1, tmp_path / "run").summary)
    assert (wrong is None) == good, wrong
