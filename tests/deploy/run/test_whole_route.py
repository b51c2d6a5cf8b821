"""A route is driven whole, wherever it ends: laps, ways there and back, and routes that pass over their goal."""

from __future__ import annotations

from math import hypot
from pathlib import Path

import pytest

from lfa.deploy.analysis.run_data import Run
from lfa.deploy.analysis.summary import Summary
from lfa.deploy.faults.script import parse_all
from lfa.deploy.run.simulate import run
from lfa.world.description.load import load

LAP = "[[2.5,0.0],[2.5,2.5],[0.0,2.5],[0.0,0.0]]"
CLOSED = "[[0.0,0.0],[2.5,0.0],[2.5,2.5],[0.0,2.5],[0.0,0.0]]"
BACK = "[[3.0,0.0],[0.0,0.0]]"
OVER_THE_GOAL = "[[4.0,0.0],[4.0,2.0],[2.0,2.0],[2.0,0.0]]"
"""Its first leg passes over the last way-point."""
PASSED_M = 0.15


def driven(
    folder: Path, route: str, *overrides: str, faults: tuple[str, ...] = (), robots: int = 2
) -> tuple[Run, Summary]:
    settings = [f"mission.leading.route_m={route}", "time_limit_s=90.0", "faults=[]", *overrides]
    scenario = load("straight", settings, robots)
    ended = run(scenario, 1, folder, parse_all(scenario.mission, (), faults))
    return Run(ended.folder), ended.summary


def missed_m(done: Run) -> list[float]:
    """Distance [m] at which the leaders of the run passed each way-point, in the route's order."""
    path = [
        (float(t), float(x), float(y))
        for reign in done.leader_terms
        for t, x, y in done.truth[reign.robot_id][:, :3]
        if reign.from_s <= t < (reign.until_s or 1e9)
    ]
    missed, at = [], 0
    for waypoint in done.scenario.mission.leading.route_m:
        apart = [hypot(x - waypoint[0], y - waypoint[1]) for _, x, y in path[at:]]
        first = next((n for n, d in enumerate(apart) if d <= PASSED_M), None)
        missed.append(min(apart, default=99.0) if first is None else apart[first])
        at += first or 0
    return missed


@pytest.mark.parametrize(
    ("motion", "route"),
    [
        ("path_following", LAP),
        ("path_following", CLOSED),
        ("path_following", BACK),
        ("path_following", OVER_THE_GOAL),
        ("point_to_point", LAP),
        ("reactive", LAP),
        ("explore", LAP),
    ],
)
def test_a_route_that_ends_where_it_began_or_passed_is_driven_whole(motion: str, route: str, tmp_path: Path) -> None:
    done, summary = driven(tmp_path / "run", route, f"mission.leading.motion={motion}")
    settings = f"--set mission.leading.motion={motion} --set mission.leading.route_m={route}"
    again = f"lfa sim straight --robots 2 --seed 1 {settings}"
    assert summary.outcome == "goal_reached", again
    assert max(missed_m(done)) <= PASSED_M, again


def test_a_trajectory_that_ends_where_it_began_is_driven_whole(tmp_path: Path) -> None:
    times = "mission.leading.times_s=[0.0,9.0,18.0,27.0,36.0]"
    done, summary = driven(tmp_path / "run", CLOSED, "mission.leading.motion=trajectory", times)
    assert summary.outcome == "goal_reached"
    assert max(missed_m(done)) <= PASSED_M


def test_a_new_leader_drives_the_rest_of_a_lap_and_no_more(tmp_path: Path) -> None:
    done, summary = driven(tmp_path / "run", LAP, faults=("kill leader at 20 s",), robots=3)
    assert summary.outcome == "goal_reached"
    assert max(missed_m(done)) <= 2.0 * PASSED_M
    second = next(reign for reign in done.leader_terms if reign.robot_id == 2)
    led = done.truth[2][done.led(2, done.truth[2][:, 0])]
    assert second.from_s > 20.0
    assert min(hypot(x - 2.5, y) for _, x, y in led[:, :3]) > 1.0, (
        "it drives to the first corner, which the team has passed"
    )


def test_a_robot_that_restarted_and_leads_goes_on_from_the_teams_progress(tmp_path: Path) -> None:
    faults = ("kill 2 at 8 s", "restart 2 at 10 s", "kill 1 at 24 s")
    done, summary = driven(tmp_path / "run", LAP, faults=faults)
    assert summary.outcome == "goal_reached"
    led = done.truth[2][done.led(2, done.truth[2][:, 0])]
    assert led.size
    assert min(hypot(x - 2.5, y) for _, x, y in led[:, :3]) > 1.0


CORNER = """
title = "a corner behind an obstacle"
time_limit_s = 60.0
[mission]
robots = [1, 2]
[mission.leading]
route_m = [[5.0, 0.0], [5.0, 3.0]]
[[world.obstacles]]
center_m = [2.5, 0.05]
radius_m = 0.3
"""


def test_after_a_detour_the_leader_returns_to_the_line_passes_the_corner_and_says_so(tmp_path: Path) -> None:
    (tmp_path / "corner.toml").write_text(CORNER)
    done = Run(run(load(str(tmp_path / "corner.toml")), 1, tmp_path / "run").folder)
    again = f"lfa sim corner.toml --seed 1 with {CORNER}"
    assert done.summary.outcome == "goal_reached", again
    assert max(missed_m(done)) <= PASSED_M, again
    route = [line for line in done.events if line["kind"] == "route"]
    assert [line["state"] for line in route] == ["left", "back"], again
    assert route[1]["off_max_m"] > 0.5
    passed = [line for line in done.events if line["kind"] == "waypoint"]
    assert [line["waypoint"] for line in passed] == [0]
    assert passed[0]["off_m"] <= PASSED_M
