"""`lfa bench motion`: what counts as a good run, and pairs of start and goal that a team can be laid out at."""

from __future__ import annotations

from math import hypot
from pathlib import Path

import pytest

from lfa.deploy.bench import motion
from lfa.deploy.run.simulate import run
from lfa.protocol.errors import Refused
from lfa.world.description import maps
from lfa.world.description.load import load, shipped


def test_every_shipped_scenario_is_a_case() -> None:
    names = {case.name for case in motion.cases(1)}
    assert {f"scenario/{name}" for name in shipped()} <= names


@pytest.mark.parametrize("ground", motion.GROUNDS, ids=lambda ground: ground.name)
def test_a_pair_is_far_apart_and_has_room_for_the_team(ground: motion.BenchMap) -> None:
    path = motion.map_of(ground)
    if path is None:
        pytest.skip(f"no shared/data/maps/{ground.name}.yaml beside the checkout or above it")
    [sets] = motion.pairs(ground, 1)
    scenario, room = load("explore", sets, ground.robots), maps.Room(maps.read(path))
    assert scenario.world.starts is not None
    (x, y, _), goal = scenario.world.starts[0], scenario.mission.goal_m
    assert len(scenario.world.starts) == ground.robots
    assert hypot(x - goal[0], y - goal[1]) > ground.apart_m - 0.02
    assert min(room.clearance_m(x, y), room.clearance_m(*goal)) > ground.clear_m - 0.01


def test_a_map_that_is_not_there_is_left_out_and_said_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(motion, "GROUNDS", (motion.BenchMap("nowhere"),))
    with pytest.raises(Refused):
        motion.run(as_json=False, rows="unknown/nowhere*")
    assert "unknown/nowhere is left out" in capsys.readouterr().err


@pytest.mark.parametrize(("goal", "limit", "good"), [(1.0, 30.0, True), (5.0, 1.0, False)])
def test_a_run_that_does_not_end_at_its_goal_is_not_good(tmp_path: Path, goal: float, limit: float, good: bool) -> None:
    sets = [f"mission.leading.route_m=[[{goal}, 0.0]]", f"time_limit_s={limit}"]
    wrong = motion.complaint(run(load("straight", sets, 2), 1, tmp_path / "run").summary)
    assert (wrong is None) == good, wrong
