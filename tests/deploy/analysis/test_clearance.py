"""Way, mean speed and least clearance of a robot, from the ground truth alone."""

from __future__ import annotations

from math import inf, pi

import numpy as np
import pytest

from lfa.deploy.analysis.clearance import EVERY, LEFT_M, MET_M, least_clearance_m, mean_speed_mps, things_near, way_m
from lfa.deploy.recording.mcap_reader import Array, RecordedRun
from lfa.world.description.load import Scenario, load

SQUARE = "[[-0.5,-0.5],[0.5,-0.5],[0.5,0.5],[-0.5,0.5]]"


def straight(y: float = 0.0, rest: int = 0) -> Array:
    """Rows of a robot that drives from x = 0 to 3 m at 0.5 m/s, then rests."""
    x = np.concatenate([np.arange(0.0, 3.001, 0.01), np.full(rest, 3.0)])
    t = 0.02 * np.arange(x.size)
    zeros = np.zeros(x.size)
    return np.column_stack([t, x, np.full(x.size, y), zeros, zeros, zeros])


def seen(**truth: Array) -> RecordedRun:
    return RecordedRun(dict(enumerate(truth.values(), start=1)), {}, {}, {})


def world(*obstacles: str) -> Scenario:
    return load("straight", [f"world.{obstacle}" for obstacle in obstacles], robots=2)


def test_way_and_mean_speed_leave_out_the_rest_before_and_after() -> None:
    rows = straight(rest=500)
    assert way_m(rows) == pytest.approx(3.0)
    assert mean_speed_mps(rows) == pytest.approx(0.5, rel=0.01)
    assert mean_speed_mps(rows[-100:]) is None, "it did not drive"


@pytest.mark.parametrize(
    ("obstacle", "gap_m"),
    [
        ("obstacles=[{center_m=[1.5,0.9], radius_m=0.3}]", 0.6),
        (f"obstacles=[{{center_m=[1.5,-1.2], corners_m={SQUARE}}}]", 0.7),
        ("walls_m=[[-1.0,0.4,9.0,0.4]]", 0.4),
    ],
)
def test_the_least_clearance_is_from_the_body_to_the_nearest_surface(obstacle: str, gap_m: float) -> None:
    scenario = world(obstacle)
    body_m = scenario.mission.radius_m
    assert least_clearance_m(1, seen(own=straight()), scenario) == pytest.approx(gap_m - body_m, abs=0.01)


@pytest.mark.parametrize(
    ("obstacle", "turned_rad", "gap_m"),
    [
        ("obstacles=[{center_m=[1.5,0.9], radius_m=0.3}]", 0.0, 0.6 - 0.215),
        (f"obstacles=[{{center_m=[1.5,-1.2], corners_m={SQUARE}}}]", 0.0, 0.7 - 0.215),
        ("walls_m=[[-1.0,0.4,9.0,0.4]]", 0.0, 0.4 - 0.215),
        ("walls_m=[[-1.0,0.4,9.0,0.4]]", pi / 2, 0.4 - 0.254),
        ("walls_m=[[1.5,0.3,1.5,2.0]]", 0.0, 0.3 - 0.215),
        ("walls_m=[[-1.0,0.4,9.0,0.4]]", pi / 4, 0.4 - (0.254 + 0.215) / 2**0.5),
    ],
)
def test_the_least_clearance_of_a_polygon_is_from_its_nearest_side_or_corner(
    obstacle: str, turned_rad: float, gap_m: float
) -> None:
    body = "body.footprint_m=[[0.254,0.215],[-0.254,0.215],[-0.254,-0.215],[0.254,-0.215]]"
    scenario = load("straight", [f"world.{obstacle}", f"world.{body}", "mission.radius_m=0.333"], robots=2)
    rows = straight()
    rows[:, 3] = turned_rad
    assert least_clearance_m(1, seen(own=rows), scenario) == pytest.approx(gap_m, abs=0.01)


def test_another_robot_counts_once_they_have_been_apart() -> None:
    scenario = world()
    behind = straight()
    behind[:, 1] -= np.minimum(0.8, 2.0 * behind[:, 1])  # both started in one place
    run = seen(own=straight(), mate=behind)
    assert least_clearance_m(1, run, scenario) == pytest.approx(0.0, abs=0.02 * EVERY)
    assert least_clearance_m(1, seen(own=straight()), scenario) == inf


def test_a_moving_obstacle_counts_where_it_was_at_that_time() -> None:
    scenario = world("obstacles=[{center_m=[3.0,2.0], radius_m=0.2, velocity_mps=[0.0,-0.25]}]")
    t = np.arange(0.0, 6.0, 0.1)
    run = RecordedRun({1: straight()}, {}, {}, {0: np.column_stack([t, np.full(t.size, 3.0), 2.0 - 0.25 * t])})
    assert least_clearance_m(1, run, scenario) == pytest.approx(0.5 - 0.2 - scenario.mission.radius_m, abs=0.03)


def test_who_plans_its_way_has_met_what_it_came_near_to_and_a_wall_each_time_anew() -> None:
    at_m = MET_M + 0.15
    scenario = world(
        f"obstacles=[{{center_m=[1.5,{at_m + 0.29}], radius_m=0.3}}, {{center_m=[1.5,{-at_m - 0.31}], radius_m=0.3}},"
        f" {{center_m=[2.5,{at_m + 0.19}], radius_m=0.2, velocity_mps=[0.01,0.0]}}]",
        f"walls_m=[[0.2,{at_m - 0.1},0.3,{at_m - 0.1}],[2.9,{at_m - 0.1},3.0,{at_m - 0.1}]]",
    )
    run = seen(own=straight())
    assert things_near(1, run, scenario) == {"stationary": 1, "moving": 1, "wall": 2}
    run = seen(own=straight(y=-LEFT_M))
    assert things_near(1, run, scenario)["wall"] == 0
