"""Ground that holds a wheel for good, in a world of its own: nobody drives into it."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfa.deploy.run.simulate import run
from lfa.world.description.load import load

SIGHT = ("world.ground.reach_m=1.0", "world.ground.increment_m=0.02")


@pytest.mark.parametrize("width_m", [0.5, 1.0])
def test_a_fast_robot_stops_before_a_deep_hole_and_goes_round_it(tmp_path: Path, width_m: float) -> None:
    hole = f"world.potholes=[{{center_m=[3.0,0.0],width_m={width_m},depth_m=0.1}}]"
    fast = ("mission.leading.cruise_mps=1.0", "mission.leading.route_m=[[5.0,0.0]]", "time_limit_s=25.0")
    assert run(load("straight", [*SIGHT, hole, *fast], 1), 1, tmp_path / "run").summary.outcome == "goal_reached"


def test_the_shipped_terrain_leaves_nobody_behind(tmp_path: Path) -> None:
    summary = run(load("terrain"), 16, tmp_path / "run").summary
    assert (summary.outcome, summary.left_behind) == ("goal_reached", []), "lfa sim terrain --seed 16"
    assert sum(robot.contacts for robot in summary.robots) == 0


def test_a_leader_whose_wheels_slip_at_a_bump_hands_over_and_comes_after(tmp_path: Path) -> None:
    """It takes the bump for lower than its wheels climb; they drive on, and its localization says one place."""
    bump = "world.bumps=[{center_m=[4.0,0.0],width_m=0.6,length_m=1.2,height_m=0.06}]"
    sets = (bump, "mission.limits.climb_step_m=0.3", "mission.leading.route_m=[[6.0,0.0]]", "time_limit_s=60.0")
    summary = run(load("straight", [*sets], 2), 1, tmp_path / "run").summary
    assert [reign.cause for reign in summary.leaders] == ["start", "handed_over"]
    assert (summary.outcome, summary.left_behind) == ("goal_reached", [])
