"""Situations of real users, in `shared/cases` beside the checkout: each input is run there, in virtual time."""

from __future__ import annotations

import json
from itertools import pairwise
from math import dist
from pathlib import Path

import pytest

from lfa.deploy.analysis.run_data import Run
from lfa.deploy.simulate import run

CASES = next((found for up in Path(__file__).resolve().parents if (found := up / "shared/cases").is_dir()), None)
pytestmark = pytest.mark.skipif(CASES is None, reason="no shared/cases beside the checkout or above it")

ELSEWHERE = {
    "1_nose_at_a_post", "2_team_leader_killed", "3_gap_called_walled_in", "driving",  # tests of the driving itself
    "disk_full_ps",  # tests/deploy/fleet/test_full_disk.py
    "driver_dies",  # tests/deploy/robot/test_driver.py, tests/processes/test_driver.py
    "gateway_future_stamp",  # tests/protocol/lease/test_gateway.py
    "greeting_over_ssh", "ipv6_hosts",  # tests/hosts/test_addresses.py
    "markup_in_status",  # tests/deploy/test_terminal_text.py
    "older_wall_clock",  # tests/protocol/lease/test_incarnations.py
    "shadowed_modules",  # tests/deploy/fleet/remote/test_answers.py, tests/hosts/test_addresses.py
}  # fmt: skip
HERE = {
    "absent_driver", "closed_route", "dead_driver_phantom", "frozen_or_lost_sensors", "leader_without_pose",
    "stale_lidar", "zero_ranges",
}  # fmt: skip


def _run(tmp_path: Path, case: str, *faults: str, settings: tuple[str, ...] = ()) -> Run:
    assert CASES is not None
    return run(str(CASES / case), seed=1, set=settings, faults=faults, out=tmp_path / "run")


def test_every_case_has_its_test() -> None:
    assert CASES is not None
    assert {folder.name for folder in CASES.iterdir() if folder.is_dir()} <= HERE | ELSEWHERE


@pytest.mark.parametrize(("name", "length_m"), [("lap", 16.0), ("uturn", 10.0), ("trajlap", 16.0)])
def test_closed_route_a_route_that_ends_where_it_began_is_driven_whole(
    tmp_path: Path, name: str, length_m: float
) -> None:
    ended = _run(tmp_path, f"closed_route/{name}.toml")
    assert ended.summary.outcome == "goal_reached"
    assert sum(dist(before[1:3], after[1:3]) for before, after in pairwise(ended.truth[1])) > 0.8 * length_m


def test_absent_driver_a_robot_without_sensors_is_left_behind_and_nobody_waits_for_it(tmp_path: Path) -> None:
    ended = _run(tmp_path, "absent_driver/absent.toml")
    assert (ended.summary.outcome, ended.summary.left_behind) == ("goal_reached", [2])


def test_leader_without_pose_another_robot_leads_to_the_goal(tmp_path: Path) -> None:
    ended = _run(tmp_path, "leader_without_pose/absent1.toml", settings=("time_limit_s=40",))
    assert (ended.summary.outcome, ended.summary.left_behind) == ("goal_reached", [1])


def test_dead_driver_phantom_a_robot_whose_driver_hangs_says_so(tmp_path: Path) -> None:
    ended = _run(tmp_path, "dead_driver_phantom/loop.toml", "hang driver 2 at 9 s", settings=("time_limit_s=20",))
    lines = [json.loads(line) for line in (ended.folder / "events.jsonl").read_text().splitlines()]
    lost = [line for line in lines if line["kind"] == "input" and line["robot"] == 2]
    assert [line["state"] for line in lost] == ["lost"], lines


def test_stale_lidar_a_team_whose_scanners_hang_for_ten_seconds_touches_nothing(tmp_path: Path) -> None:
    ended = _run(tmp_path, "stale_lidar/course.toml", settings=("world.lidar.rate_hz=0.1",))
    assert sum(robot.contacts for robot in ended.summary.robots) == 0


def test_frozen_or_lost_sensors_a_scanner_that_hangs_stops_its_robot_before_the_wall(tmp_path: Path) -> None:
    ended = _run(tmp_path, "frozen_or_lost_sensors/course.toml", "hang scanner 1 at 4 s")
    assert sum(robot.contacts for robot in ended.summary.robots) == 0


@pytest.mark.parametrize("seed", [1, 2])
def test_frozen_or_lost_sensors_with_the_commonest_cheap_scanners_five_scans_a_second_nobody_is_touched(
    tmp_path: Path, seed: int
) -> None:
    """At five scans a second the speed is halved: lfa sim course.toml --seeds 1..20 --set world.lidar.rate_hz=5."""
    assert CASES is not None
    course, settings = str(CASES / "frozen_or_lost_sensors/course.toml"), ("world.lidar.rate_hz=5", "time_limit_s=120")
    ended = run(course, seed=seed, set=settings, out=tmp_path / "run")
    assert (ended.summary.outcome, ended.summary.left_behind) == ("goal_reached", [])
    assert [robot.contacts for robot in ended.summary.robots] == [0, 0, 0]


def test_zero_ranges_the_yard_is_explored(tmp_path: Path) -> None:
    ended = _run(tmp_path, "zero_ranges/open.toml")
    assert ended.summary.outcome == "goal_reached"
