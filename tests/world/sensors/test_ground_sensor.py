"""The ground sensor: at each of its points the height of what lies there, wherever the robot and the patches are."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, hypot, sin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from lfa.protocol.geometry import Pose2D
from lfa.world.description.load import load
from lfa.world.description.scenario import WorldSpec
from lfa.world.description.terrain import Bump, Ditch, Pothole, patches_of
from lfa.world.sensors.ground_sensor import Profiler

FAR = 1.5
"""Distance [m] ahead of the last point of each line."""
SIDE = 0.12
"""Distance [m] of the left line from the centre's."""
near = st.floats(-2.5, 2.5)


def profiler(world: WorldSpec) -> Profiler:
    return Profiler(replace(load("straight", ["mission.robots=[1]"]), world=world))


def points(pose: Pose2D, offsets_m: Sequence[float]) -> list[list[tuple[float, float]]]:
    """Each line's points in `map`."""
    c, s = cos(pose.theta), sin(pose.theta)
    return [
        [(pose.x + c * ahead - s * beside, pose.y + s * ahead + c * beside) for ahead in along]
        for beside in offsets_m
        for along in [[0.1 + 0.05 * n for n in range(29)]]
    ]


@settings(max_examples=60)
@given(
    at=st.tuples(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(-3.1, 3.1)),
    hole=st.tuples(near, near, st.floats(0.1, 1.0)),
    bar=st.tuples(near, near, st.floats(0.05, 0.5), st.floats(0.1, 2.0), st.floats(-3.1, 3.1)),
)
def test_a_height_is_that_of_the_first_patch_that_covers_the_point(
    at: tuple[float, float, float], hole: tuple[float, float, float], bar: tuple[float, float, float, float, float]
) -> None:
    """Of a robot anywhere; another one stands far away."""
    x, y, theta = at
    world = WorldSpec(
        potholes=(Pothole((x + hole[0], y + hole[1]), width_m=hole[2], depth_m=0.03),),
        bumps=(Bump((x + bar[0], y + bar[1]), width_m=bar[2], length_m=bar[3], height_m=0.02, theta=bar[4]),),
    )
    seer, patches, pose = profiler(world), patches_of(world), Pose2D(x, y, theta)
    seen = seer.profile([Pose2D(x + 90.0, y - 90.0, 0.0), pose], [0.0, 0.0])
    assert not seen[0].any()
    for line, row in zip(seen[1], points(pose, seer.offsets_m), strict=True):
        for height, point in zip(line.tolist(), row, strict=True):
            there = next((patch for patch in patches if patch.covers(*point)), None)
            sure = all(abs(patch.gap_m(*point)) > 1e-9 or patch.covers(*point) for patch in patches)
            assert not sure or height == (0.0 if there is None else there.height_m)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_hole_at_the_last_point_of_an_outer_line_shows_there_alone(side: float) -> None:
    """Its middle lies beyond the point, as far from the robot as a hole that shows can be."""
    far = hypot(FAR, SIDE)
    away = (far + 0.0099) / far
    hole = Pothole((FAR * away, side * SIDE * away), width_m=0.02, depth_m=0.05)
    heights = profiler(WorldSpec(potholes=(hole,))).profile([Pose2D()], [0.0])[0]
    assert heights[0 if side > 0.0 else 2, -1] == -0.05
    assert (heights != 0.0).sum() == 1


def test_a_ditch_whose_middle_is_far_away_shows_where_it_begins() -> None:
    ditch = Ditch(ends_m=((0.77, 0.0), (9.0, 0.0)), width_m=0.1, depth_m=0.05)
    left, centre, right = profiler(WorldSpec(ditches=(ditch,))).profile([Pose2D()], [0.0])[0]
    assert centre.tolist() == [0.0] * 14 + [-0.05] * 15
    assert not left.any() and not right.any()


def test_a_robot_that_stands_in_a_hole_sees_the_floor_around_above_itself() -> None:
    hole = Pothole((0.0, 0.0), width_m=1.0, depth_m=0.05)
    centre = profiler(WorldSpec(potholes=(hole,))).profile([Pose2D()], [-0.05])[0][1]
    assert centre[0] == 0.0
    assert centre[-1] == 0.05
