"""The age of the scan acts: no scan or only repeated ones slow a robot, then stop it, then free its chain."""

from __future__ import annotations

from math import cos, inf, nan, sin
from pathlib import Path
from typing import Any

import pytest
from msgspec import structs

from lfa.agents.perception.scan_age import GONE_BEAMS, SCAN_S_MAX, ScanAge
from lfa.deploy.recording import event_log
from lfa.deploy.run.simulate import run
from lfa.protocol.geometry import STILL, Pose2D, Twist
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import LaserScan
from lfa.protocol.topics import TOPIC
from lfa.world.description.load import load

GO = Twist(0.4, 0.2)
REPRODUCE = "lfa sim straight --set world.lidar.rate_hz=0.1"


def scan(*ranges: float) -> LaserScan:
    return LaserScan(Header("robot1", 1, 0, 0.0), 0.0, 0.1, 0.05, 8.0, ranges)


def test_its_limit_is_the_topics() -> None:
    assert TOPIC["scan"].timeout_s == SCAN_S_MAX


def test_a_robot_without_a_scanner_is_not_limited() -> None:
    assert ScanAge().limited(GO, 100.0) == GO


def test_an_old_scan_slows_then_stops_and_a_new_one_lets_go() -> None:
    age = ScanAge()
    age.update(scan(1.0), Pose2D(), 10.0)
    assert age.limited(GO, 10.0 + SCAN_S_MAX) == GO
    half = age.limited(GO, 10.0 + 1.5 * SCAN_S_MAX)
    assert (half.linear_x, half.angular_z) == (pytest.approx(0.2), pytest.approx(0.1))
    assert age.limited(GO, 10.0 + 2.01 * SCAN_S_MAX) == STILL
    assert age.lost(10.0 + 2.01 * SCAN_S_MAX)
    age.update(scan(0.9), Pose2D(), 11.0)
    assert age.limited(GO, 11.1) == GO


WALL_AHEAD = tuple(1.0 / cos(0.1 * n) for n in range(8))
"""A wall one metre ahead, from straight ahead to the left."""
LONG_WALL = (*(inf,) * 8, *(0.55 / sin(0.1 * n) for n in range(8, 16)))
"""A wall to the left, along the motion."""


@pytest.mark.parametrize("motion", [Pose2D(0.04, 0.0, 0.0), Pose2D(0.0, 0.0, 0.04)])
def test_a_scan_that_repeats_itself_while_the_robot_moves_is_none(motion: Pose2D) -> None:
    age = ScanAge()
    for n in range(20):
        age.update(scan(*WALL_AHEAD), Pose2D(motion.x * n, 0.0, motion.theta * n), 0.1 * n)
    assert age.limited(GO, 1.9) == STILL


@pytest.mark.parametrize(
    ("ranges", "step_m"), [(WALL_AHEAD, 0.0), ((inf, inf), 0.04), (LONG_WALL, 0.04)], ids=["rest", "open", "long wall"]
)
def test_equal_scans_are_scans_where_nothing_need_change(ranges: tuple[float, ...], step_m: float) -> None:
    age = ScanAge()
    for n in range(20):
        assert age.update(scan(*ranges), Pose2D(step_m * n, 0.0, 0.0), 0.1 * n)
    assert age.limited(GO, 1.9) == GO


@pytest.mark.parametrize("turns", [2, 5])
def test_a_driver_that_repeats_its_last_turns_gives_no_scans(turns: int) -> None:
    """As one does whose buffer is no longer filled."""
    age = ScanAge()
    for n in range(40):
        nearer = min(n, 10 + n % turns)
        age.update(scan(*(r - 0.02 * nearer for r in WALL_AHEAD)), Pose2D(0.04 * n, 0.0, 0.0), 0.1 * n)
    assert age.limited(GO, 3.9) == STILL


def test_all_that_stood_around_a_robot_is_not_gone_from_one_scan_to_the_next() -> None:
    age = ScanAge()
    assert age.update(scan(*(1.0,) * GONE_BEAMS, inf, inf), Pose2D(), 0.0)
    nothing = scan(*(inf,) * (GONE_BEAMS + 2))
    assert not age.update(nothing, Pose2D(0.04, 0.0, 0.0), 0.1)
    assert age.update(nothing, Pose2D(2.0, 0.0, 0.0), 9.0), "where the robot has come, nothing need be"


def test_what_few_beams_saw_may_have_been_taken_away() -> None:
    age = ScanAge()
    age.update(scan(1.0, 1.1, *(inf,) * 6), Pose2D(), 0.0)
    assert age.update(scan(*(inf,) * 8), Pose2D(), 0.1)


@pytest.mark.parametrize(("range_min_m", "counts"), [(0.5, True), (0.6, False)])
def test_a_scanner_that_sees_nothing_near_shows_no_way_past_anything(range_min_m: float, counts: bool) -> None:
    far = structs.replace(scan(2.0, inf), range_min_m=range_min_m)
    assert ScanAge().update(far, Pose2D(), 0.0) is counts


def test_a_scanner_that_stops_drives_nobody_into_an_obstacle(tmp_path: Path) -> None:
    obstacle = "world.obstacles=[{center_m=[7.5, 0.1], radius_m=0.4}]"
    sets = ["mission.leading.route_m=[[12.0, 0.0]]", "world.lidar.rate_hz=0.1", "time_limit_s=40.0", obstacle]
    done = run(load("straight", sets, 3), 1, tmp_path / "run")
    assert sum(robot.contacts for robot in done.summary.robots) == 0, REPRODUCE
    lost = [line for line in event_log.of_kind(event_log.lines(done.folder), "input") if line["state"] == "lost"]
    assert {line["robot"] for line in lost} == {1, 2, 3}, REPRODUCE


@pytest.mark.parametrize(("rate_hz", "speed_mps"), [(10.0, 1.0), (8.0, 1.0), (5.0, 0.5), (2.0, 0.2)])
def test_scans_at_a_lower_rate_than_the_braking_margin_assumes_lower_the_speed(
    rate_hz: float, speed_mps: float
) -> None:
    age = ScanAge()
    for n in range(10):
        age.update(scan(1.0 + 0.01 * n), Pose2D(), n / rate_hz)
    assert age.speed_max_mps(1.0) == pytest.approx(speed_mps)
    assert (age.slow_hz is None) == (speed_mps == 1.0)


def test_a_team_with_slow_scanners_drives_slowly_and_warns(tmp_path: Path) -> None:
    settings = ["mission.leading.route_m=[[4.0, 0.0]]", "world.lidar.rate_hz=5", "faults=[]"]
    ended = run(load("straight", settings, 2), 1, tmp_path / "run")
    said = [line for line in event_log.lines(ended.folder) if line["kind"] == "input"]
    assert {line["robot"] for line in said if line.get("state") == "slow"} == {1, 2}
    assert ended.summary.outcome == "goal_reached"
    assert ended.summary.sim_duration_s > 4.0 / 0.25, "lfa sim straight --robots 2 --set world.lidar.rate_hz=5"


@pytest.mark.parametrize("bad", [nan, 0.0, -inf], ids=["nan", "0", "-inf"])
def test_a_repeated_scan_with_bad_beams_is_a_repeated_scan(bad: float) -> None:
    age = ScanAge()
    for n in range(20):
        ranges = (*WALL_AHEAD, float(str(bad)), float(str(bad)))  # as two decoded messages: not the same objects
        age.update(scan(*ranges), Pose2D(0.04 * n, 0.0, 0.0), 0.1 * n)
    assert age.limited(GO, 1.9) == STILL


@pytest.mark.parametrize("bad", [nan, 0.0, -inf, 0.01], ids=["nan", "0", "-inf", "too near"])
def test_a_scanner_that_measures_nothing_stops_its_robot(bad: float) -> None:
    """Also from the first scan on: a robot with a cap on its scanner is none without a scanner."""
    age = ScanAge()
    for n in range(20):
        assert not age.update(scan(*(bad,) * 8), Pose2D(), 0.1 * n)
    assert age.limited(GO, 1.9) == STILL
    assert age.update(scan(inf, bad), Pose2D(), 2.0), "nothing within the range is a reading"


@pytest.mark.parametrize(
    "said",
    [
        {"range_min_m": 8.0, "range_max_m": 0.05},
        {"range_min_m": 8.0, "range_max_m": 8.0},
        {"range_max_m": 0.0},
        {"range_max_m": -8.0},
        {"range_max_m": 0.04},
        {"angle_increment": 0.0},
        {"angle_increment": 1e9},
        {"ranges_m": ()},
        {"ranges_m": (-1.0, -2.0)},
        {"range_min_m": 2.0, "ranges_m": (0.1, 1.9)},
    ],
    ids=str,
)
def test_a_scan_in_which_nothing_can_be_seen_is_none(said: dict[str, Any]) -> None:
    """It shows no obstacle, as a free room does: its robot would drive on at full speed."""
    age = ScanAge()
    age.update(scan(1.0, 2.0), Pose2D(), 0.0)
    for n in range(1, 20):
        assert not age.update(structs.replace(scan(1.0, 2.0 + 0.1 * n), **said), Pose2D(), 0.1 * n)
    assert age.limited(GO, 1.9) == STILL


def test_beams_from_left_to_right_and_a_single_beam_are_a_scan() -> None:
    age = ScanAge()
    assert age.update(structs.replace(scan(1.0, 2.0), angle_increment=-0.1), Pose2D(), 0.0)
    assert age.update(structs.replace(scan(1.5), angle_increment=0.0), Pose2D(), 0.1)


def test_a_scan_that_was_made_long_ago_is_none() -> None:
    age = ScanAge()
    for n in range(20):
        age.update(scan(1.0 + 0.01 * n), Pose2D(), 0.1 * n, late_s=SCAN_S_MAX + 0.01)
    assert age.limited(GO, 1.9) == STILL
    assert age.update(scan(0.9), Pose2D(), 2.0, late_s=SCAN_S_MAX - 0.01)
