"""The ground as a scenario gives it: its shapes, the profile a robot sees of it, what a seed draws, what is refused."""

from __future__ import annotations

from itertools import pairwise
from math import cos, hypot, inf, isinf, isnan, nan, pi, sin
from statistics import stdev

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfa.protocol.errors import Refused
from lfa.protocol.geometry import Pose2D
from lfa.world.description.load import Scenario, draw, load
from lfa.world.description.obstacle_motion import WALK_LEG_S, way_of
from lfa.world.description.scenario import Lidar, Noise, Obstacle
from lfa.world.description.terrain import Bump, Ditch, Pothole, features, patch_of, patches_of
from lfa.world.sensors.ground_sensor import Profiler
from lfa.world.sensors.noise import HeightNoise, RangeNoise

ROUND = Pothole(center_m=(2.0, 1.0), width_m=0.6, depth_m=0.1)
SHAPES = {
    "round": ROUND,
    "rectangular": Pothole(center_m=(2.0, 1.0), width_m=0.4, length_m=1.0, depth_m=0.1, theta=0.5),
    "bump": Bump(center_m=(2.0, 1.0), width_m=0.3, length_m=1.5, height_m=0.02, theta=-1.0),
    "ditch": Ditch(ends_m=((1.5, 0.0), (2.5, 2.0)), width_m=0.3, depth_m=0.5),
}
ALONE = "mission.robots=[1]"


def world(*overrides: str) -> Scenario:
    return load("straight", [ALONE, *overrides])


# --- shapes ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", SHAPES)
@given(x=st.floats(0.5, 3.5), y=st.floats(-0.5, 2.5), angle=st.floats(-3.1, 3.1))
def test_cover_gap_and_chord_of_a_shape_agree(shape: str, x: float, y: float, angle: float) -> None:
    """The chord is what small steps along the line find covered; the gap is zero exactly on the shape."""
    patch = patch_of(SHAPES[shape])
    assert (patch.gap_m(x, y) == 0.0) == patch.covers(x, y) or patch.gap_m(x, y) < 1e-12
    step_m, c, s = 0.005, cos(angle), sin(angle)
    covered = sum(patch.covers(x + i * step_m * c, y + i * step_m * s) for i in range(-800, 801)) * step_m
    assert patch.chord_m(x, y, c, s) == pytest.approx(covered, abs=2.1 * step_m)


def test_a_ditch_is_as_wide_and_long_as_stated_and_corners_lie_on_its_edge() -> None:
    patch = patch_of(SHAPES["ditch"])
    sides = [hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(patch.corners_m)]
    assert sides == pytest.approx([hypot(1, 2), 0.3, hypot(1, 2)])
    assert all(hypot(x - patch.x, y - patch.y) == pytest.approx(patch.reach_m) for x, y in patch.corners_m)


# --- what a robot sees of it -------------------------------------------------------------------------------------


def test_a_flat_floor_is_zero_on_three_lines_from_10_cm_to_1_5_m() -> None:
    profiler = Profiler(world())
    assert profiler.offsets_m == pytest.approx((0.12, 0.0, -0.12))
    heights = profiler.profile([Pose2D(1, 2, 3)], [0.0])
    assert heights.shape == (1, 3, 29)
    assert not heights.any()


@pytest.mark.parametrize("shape", SHAPES)
def test_a_profile_shows_the_height_of_what_covers_each_point(shape: str) -> None:
    feature = SHAPES[shape]
    key = {Pothole: "potholes", Bump: "bumps", Ditch: "ditches"}[type(feature)]
    scenario = world()
    scenario = type(scenario)(
        scenario.title,
        scenario.mission,
        1.0,
        type(scenario.world)(**{key: (feature,)}),  # type: ignore[arg-type]
    )
    profiler, patch = Profiler(scenario), patch_of(feature)
    seen = 0
    for pose in (Pose2D(1.2, 0.9, 0.2), Pose2D(2.4, 2.0, -1.9), Pose2D(1.6, 1.0, 0.0), Pose2D(-3.0, 0.0, 0.0)):
        heights = profiler.profile([Pose2D(9, 9, 0), pose], [0.0, 0.01])[1]
        for line, beside in enumerate(profiler.offsets_m):
            for point in range(29):
                ahead = 0.1 + 0.05 * point
                x = pose.x + ahead * cos(pose.theta) - beside * sin(pose.theta)
                y = pose.y + ahead * sin(pose.theta) + beside * cos(pose.theta)
                inside = patch.covers(x, y)
                seen += inside
                assert heights[line, point] == pytest.approx((patch.height_m if inside else 0.0) - 0.01)
    assert seen > 10


def test_a_hole_beside_the_tracks_does_not_show_and_one_under_one_wheel_shows_on_its_line_alone() -> None:
    hole = "world.potholes=[{{center_m=[0.8,{}], width_m=0.2, depth_m=0.1}}]"
    beside = Profiler(world(hole.format(0.3))).profile([Pose2D()], [0.0])[0]
    assert not beside.any()
    left, centre, right = Profiler(world(hole.format(0.15))).profile([Pose2D()], [0.0])[0]
    assert left.min() == -0.1
    assert not centre.any()
    assert not right.any()


def test_of_two_features_in_one_place_the_first_shows() -> None:
    """As the wheels find them: potholes before bumps."""
    hole = "world.potholes=[{center_m=[0.8,0], width_m=0.3, length_m=2, depth_m=0.02}]"
    bump = "world.bumps=[{center_m=[0.8,0], width_m=0.3, length_m=2, height_m=0.01}]"
    scenario = world(hole, bump)
    first = next(patch for patch in patches_of(scenario.world) if patch.covers(0.8, 0.0))
    assert {patch.height_m for patch in patches_of(scenario.world)} == {-0.02, 0.01}
    heights = Profiler(scenario).profile([Pose2D()], [0.0])[0]
    assert heights[1][round((0.8 - 0.1) / 0.05)] == pytest.approx(first.height_m)


def test_a_floor_deeper_than_the_sensor_sees_is_minus_infinity() -> None:
    heights = Profiler(world("world.ditches=[{ends_m=[[0.8,-1],[0.8,1]], width_m=0.2, depth_m=3}]")).profile(
        [Pose2D()], [0.0]
    )
    assert set(heights.ravel().tolist()) == {0.0, -inf}


def test_heights_scatter_as_stated_some_are_missing_and_some_are_wrong() -> None:
    noise = HeightNoise(Noise(ground_m=0.002, ground_dropout=0.1, ground_outlier=0.05), 1, 1)
    heights = np.array([h for _ in range(40) for row in noise.apply(np.zeros((3, 29))) for h in row])
    there = heights[~np.isnan(heights)]
    assert len(there) / len(heights) == pytest.approx(0.9, abs=0.02)
    right = there[np.abs(there) < 0.008]
    assert stdev(right.tolist()) == pytest.approx(0.002, rel=0.1)
    assert 1.0 - len(right) / len(there) == pytest.approx(0.05 * 0.92, abs=0.015)
    assert np.abs(there).max() < 0.11


def test_missing_heights_are_nan_too_deep_ones_stay_and_a_clean_profile_is_exact() -> None:
    exact = np.array([[0.0, -0.1234, -inf]] * 3)
    assert HeightNoise(Noise(), 1, 1).apply(exact) == ((0.0, -0.1234, -inf),) * 3
    assert all(isnan(h) for row in HeightNoise(Noise(ground_dropout=1.0), 1, 1).apply(exact) for h in row)
    noisy = HeightNoise(Noise(ground_m=0.01, ground_outlier=0.5), 1, 1).apply(exact)
    assert all(isinf(row[2]) for row in noisy)


def test_height_noise_is_the_seeds_and_the_robots() -> None:
    def drawn(seed: int, robot_id: int) -> object:
        return HeightNoise(Noise(ground_m=0.01), seed, robot_id).apply(np.zeros((3, 29)))

    assert drawn(1, 1) == drawn(1, 1)
    assert len({drawn(1, 1), drawn(1, 2), drawn(2, 1)}) == 3


def test_a_scans_outliers_read_anything_between_the_limits() -> None:
    noise = RangeNoise(Noise(range_outlier=0.2), Lidar(), 1, 1)
    measured = np.array(noise.apply(np.full(5000, 2.0)))
    wrong = measured[measured != 2.0]
    assert len(wrong) == pytest.approx(1000, rel=0.1)
    assert 0.05 <= wrong.min() < 0.2
    assert 7.8 < wrong.max() <= 8.0


# --- what moves --------------------------------------------------------------------------------------------------


def test_straight_on_is_constant_velocity() -> None:
    way = way_of(Obstacle(center_m=(1.0, 2.0), radius_m=0.2, velocity_mps=(0.3, -0.1)))
    assert way.at(0.0) == (1.0, 2.0)
    assert way.at(10.0) == pytest.approx((4.0, 1.0))


def test_a_random_walk_keeps_its_speed_and_its_bounds_and_is_the_seeds() -> None:
    walker = Obstacle(center_m=(1.0, 2.0), radius_m=0.2, walk_m=1.5, speed_mps=0.4)
    scenario = world("world.obstacles=[{center_m=[3,2], radius_m=0.2, walk_m=1.5, speed_mps=0.4}]")
    ways = [way_of(draw(scenario, seed).world.obstacles[0]) for seed in (1, 1, 2)]
    places = [[way.at(0.1 * step) for step in range(3000)] for way in ways]
    assert places[0] == places[1] != places[2]
    assert all(hypot(x - 3.0, y - 2.0) <= 1.5 + 1e-9 for x, y in places[0])
    steps = [hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(places[0])]
    assert max(steps) == pytest.approx(0.04)
    assert min(steps) > 0.039
    assert len({round(way_of(walker).at(leg * WALK_LEG_S)[0], 6) for leg in range(50)}) > 20


def test_the_seed_moves_terrain_as_obstacles_and_keeps_it_off_starts_and_goal() -> None:
    scenario = world(
        "world.potholes=[{center_m=[2,0], width_m=0.4, depth_m=0.1}]",
        "world.bumps=[{center_m=[4,0], width_m=0.3, length_m=1, height_m=0.01}]",
        "world.ditches=[{ends_m=[[1,-3],[3,-3]], width_m=0.3, depth_m=0.1}]",
        "world.vary.obstacles_m=0.3",
    )
    places = {
        key: {(patch_of(dict(features(draw(scenario, seed).world))[key]).x) for seed in range(20)}
        for key, _ in features(scenario.world)
    }
    assert [len(drawn) for drawn in places.values()] == [20, 20, 20]
    assert max(places["potholes[0]"]) < 2.3
    assert draw(scenario, 3) == draw(scenario, 3)
    near = world("world.potholes=[{center_m=[0.9,0], width_m=0.4, depth_m=0.1}]", "world.vary.obstacles_m=0.3")
    for seed in range(20):
        assert patch_of(draw(near, seed).world.potholes[0]).gap_m(0.0, 0.0) >= 0.65


# --- what is refused ---------------------------------------------------------------------------------------------

POTHOLE = "world.potholes=[{{center_m=[{x},0], width_m={w}, depth_m={d}}}]"
BODY = "world.obstacles=[{{center_m=[3,2], radius_m=0.2, {}}}]"


@pytest.mark.parametrize(
    ("override", "line"),
    [
        (POTHOLE.format(x=2, w=-0.3, d=0.1), "world.potholes[0].width_m = -0.3: must be a number from 0.02 to 1000"),
        (POTHOLE.format(x=2, w=0.3, d=-1), "world.potholes[0].depth_m = -1.0: must be a number from 0.001 to 10"),
        (
            POTHOLE.format(x=0.2, w=0.3, d=0.1),
            "world.potholes[0] = at [0.2, 0.0]: must be clear of the start of robot 1",
        ),
        (POTHOLE.format(x=40, w=0.3, d=0.1), "world.potholes[0] = at [40.0, 0.0]: must be clear of the goal"),
        (
            "world.bumps=[{center_m=[2,0], width_m=0.3, length_m=-1, height_m=0.1}]",
            "world.bumps[0].length_m = -1.0: must be",
        ),
        (
            "world.bumps=[{center_m=[2,0], width_m=0.3, length_m=1, height_m=0}]",
            "world.bumps[0].height_m = 0.0: must be",
        ),
        (
            "world.ditches=[{ends_m=[[2,0],[2,0]], width_m=0.3, depth_m=1}]",
            "world.ditches[0].ends_m = [[2.0, 0.0], [2.0, 0.0]]: must be two different points",
        ),
        (
            "world.ditches=[{ends_m=[[-1,0],[2,0]], width_m=0.3, depth_m=1}]",
            "world.ditches[0] = at [0.5, 0.0]: must be clear of the start",
        ),
        ("world.body.wheel_radius_m=-0.1", "world.body.wheel_radius_m = -0.1: must be"),
        ("world.noise.ground_dropout=2", "world.noise.ground_dropout = 2.0: must be"),
        ("world.ground.increment_m=0", "world.ground.increment_m = 0.0: must be"),
        (BODY.format("velocity_mps=[0,0]"), "world.obstacles[0].velocity_mps = [0.0, 0.0]: must be from 0.001"),
        (BODY.format("velocity_mps=[1,0], walk_m=1"), "world.obstacles[0] = velocity_mps and walk_m: must be one way"),
        (BODY.format("walk_m=1"), "world.obstacles[0].speed_mps = 0.0: must be above 0 with waypoints_m or walk_m"),
        (BODY.format("walk_m=0.1, speed_mps=0.3"), "world.obstacles[0].walk_m = 0.1: must be a number from speed_mps"),
        (BODY.format("velocity_mps=[1,0], mass_kg=2"), "world.obstacles[0].mass_kg = 2.0: must be left out"),
    ],
)
def test_ground_and_movers_of_which_no_world_can_be_made_are_refused_in_one_line(override: str, line: str) -> None:
    with pytest.raises(Refused) as refused:
        world(override)
    said = str(refused.value)
    assert "--set" in said.partition(": ")[0]
    assert line in said
    assert "\n" not in said


def test_no_number_of_terrain_may_be_nan() -> None:
    with pytest.raises(Refused):
        world(POTHOLE.format(x=2, w=nan, d=pi))
