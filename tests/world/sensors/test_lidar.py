"""Lidar: the batch call sees what the engine's own ray query sees, and says so as REP-117 wants it."""

from __future__ import annotations

from math import cos, hypot, inf, pi, sin

import numpy as np
import pymunk
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lfa.deploy.bench import lidar as bench
from lfa.protocol.geometry import TAU, Pose2D
from lfa.world.description.load import Lidar, load
from lfa.world.description.placement import to_segment
from lfa.world.description.scenario import Obstacle, Scenario
from lfa.world.sensors.lidar import ANGLE_MIN, Scanner, cast, outline, robot_outlines

BEAMS = 72
AHEAD, LEFT, BEHIND, RIGHT = BEAMS // 2, BEAMS * 3 // 4, 0, BEAMS // 4


def scene(*overrides: str) -> Scenario:
    return load("straight", ["mission.robots=[1]", f"world.lidar.beams={BEAMS}", *overrides])


def look(pose: Pose2D, *overrides: str) -> list[float]:
    """The one robot's ranges."""
    ranges: list[float] = Scanner(scene(*overrides)).scan([pose], {})[0].tolist()
    return ranges


def test_an_empty_world_is_out_of_range_everywhere() -> None:
    assert look(Pose2D()) == [inf] * BEAMS


def test_a_round_obstacle_is_seen_where_it_stands_and_nowhere_else() -> None:
    ranges = look(Pose2D(1.0, 2.0, pi / 2), "world.obstacles=[{center_m=[1,5], radius_m=0.5}]")
    assert ranges[AHEAD] == pytest.approx(2.5)
    seen = [n for n, r in enumerate(ranges) if r < inf]
    assert seen == [AHEAD - 1, AHEAD, AHEAD + 1], "asin(0.5/3) is 9.6 degrees, a beam is 5"


def test_walls_all_round_leave_no_gap() -> None:
    room = "world.walls_m=[[-2,-2,2,-2],[2,-2,2,2],[2,2,-2,2],[-2,2,-2,-2]]"
    ranges = look(Pose2D(0.0, 0.0, 0.3), room, "mission.leading.route_m=[[1.0, 0.0]]")
    assert all(2.0 <= r <= hypot(2.0, 2.0) + 1e-9 for r in ranges)


def test_a_wall_to_the_left_is_on_the_left() -> None:
    ranges = look(Pose2D(0.0, 0.0, 0.0), "world.walls_m=[[-1,3,1,3]]")
    assert ranges[LEFT] == pytest.approx(3.0)
    assert ranges[AHEAD] == ranges[RIGHT] == ranges[BEHIND] == inf


def test_a_wall_behind_is_seen_across_the_seam_of_the_scan() -> None:
    ranges = look(Pose2D(0.0, 0.0, 0.0), "world.walls_m=[[-3,-1,-3,1]]")
    assert ranges[BEHIND] == pytest.approx(3.0)
    assert ranges[1] == ranges[-1] == pytest.approx(3.0 / cos(TAU / BEAMS))


def test_what_is_beyond_the_range_is_inf_and_what_is_too_near_is_minus_inf() -> None:
    assert look(Pose2D(), "world.walls_m=[[9,-1,9,1]]")[AHEAD] == inf
    assert look(Pose2D(0.96, 0.0, 0.0), "world.walls_m=[[1,-1,1,1]]")[AHEAD] == -inf


def test_inside_an_obstacle_nothing_else_is_seen() -> None:
    assert look(Pose2D(5.1, 0.0, 0.0), "world.obstacles=[{center_m=[5,0], radius_m=0.5}]") == [-inf] * BEAMS


def test_a_wall_seen_edge_on_is_as_near_as_its_end() -> None:
    assert look(Pose2D(), "world.walls_m=[[2,0,4,0]]")[AHEAD] == pytest.approx(2.0)


def test_robots_see_each_other_and_not_themselves() -> None:
    a, b = Scanner(scene()).scan([Pose2D(), Pose2D(3.0, 0.0, 0.0)], {})
    assert a[AHEAD] == pytest.approx(2.85)
    assert b[BEHIND] == pytest.approx(2.85)
    assert np.isinf(a).sum() == np.isinf(b).sum() == BEAMS - 1


def test_an_obstacle_that_moved_is_seen_where_it_is_now() -> None:
    scanner = Scanner(scene("world.obstacles=[{center_m=[5,0], corners_m=[[0,-1],[1,-1],[1,1],[0,1]], mass_kg=5}]"))
    assert scanner.scan([Pose2D()], {0: Pose2D(5.0, 0.0, 0.0)})[0][AHEAD] == pytest.approx(5.0)
    assert scanner.scan([Pose2D()], {0: Pose2D(5.0, 0.0, pi)})[0][AHEAD] == pytest.approx(4.0)
    assert scanner.scan([Pose2D()], {0: Pose2D(0.0, 5.0, 0.0)})[0][AHEAD] == inf


coordinate = st.floats(-8.0, 8.0)
circle = st.tuples(coordinate, coordinate, st.floats(0.05, 1.0))
segment = st.tuples(coordinate, coordinate, coordinate, coordinate).filter(
    lambda s: hypot(s[2] - s[0], s[3] - s[1]) > 0.1
)


@settings(max_examples=150)
@given(
    circles=st.lists(circle, max_size=6),
    segments=st.lists(segment, max_size=6),
    thetas=st.lists(st.floats(-3.1, 3.1), min_size=1, max_size=3),
    beams=st.sampled_from([5, 36, 97]),
)
def test_the_batch_sees_what_the_engine_sees(
    circles: list[tuple[float, float, float]],
    segments: list[tuple[float, float, float, float]],
    thetas: list[float],
    beams: int,
) -> None:
    poses = np.array([(4.0 * n, 0.3 * n, theta) for n, theta in enumerate(thetas)])
    clear = [c for c in circles if all(hypot(c[0] - x, c[1] - y) > c[2] + 0.06 for x, y, _ in poses)]
    segments = [s for s in segments if all(_is_fair(s, x, y) for x, y, _ in poses)]
    lidar = Lidar(beams=beams)
    bodies = robot_outlines(poses, (), 0.15)
    ranges = cast(poses, bodies, np.array(clear).reshape(-1, 3), np.array(segments).reshape(-1, 4), lidar)
    for n, pose in enumerate(poses):
        for beam in range(beams):
            angle = pose[2] + ANGLE_MIN + beam * TAU / beams
            low, high = _by_the_engine(poses, n, clear, segments, angle, lidar)
            # A ray that grazes an edge hits or misses by rounding: any answer between its neighbours' is right.
            assert low - 2e-3 <= max(ranges[n, beam], 0.0) <= high + 2e-3, (n, beam, ranges[n, beam], low, high)


def _is_fair(s: tuple[float, float, float, float], x: float, y: float) -> bool:
    """Neither on the scanner nor edge-on to it, which the engine, whose walls have no thickness, never sees."""
    twice_area = abs((s[0] - x) * (s[3] - y) - (s[1] - y) * (s[2] - x))
    return to_segment((x, y), s[:2], s[2:]) > 0.06 and twice_area > 1e-3


def _by_the_engine(poses, robot, circles, segments, angle, lidar):  # type: ignore[no-untyped-def]
    """Least and largest range that pymunk finds along the beam and a hair to both sides of it."""
    space = pymunk.Space()
    ground = space.static_body
    for n, (x, y, _) in enumerate(poses):
        if n != robot:
            space.add(pymunk.Circle(ground, 0.15, (x, y)))
    space.add(*(pymunk.Circle(ground, r, (x, y)) for x, y, r in circles))
    space.add(*(pymunk.Segment(ground, s[:2], s[2:], 0.0) for s in segments))
    x, y, _ = poses[robot]
    found = []
    for aside in (-1e-5, 0.0, 1e-5):
        end = x + lidar.range_max_m * cos(angle + aside), y + lidar.range_max_m * sin(angle + aside)
        hit = space.segment_query_first((x, y), end, 0.0, pymunk.ShapeFilter())
        near = hit.alpha * lidar.range_max_m if hit is not None else inf
        found.append(0.0 if near < lidar.range_min_m else near)
    return min(found), max(found)


def test_bench_rows_have_the_agreed_fields(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "MEASURE_S", 0.001)
    monkeypatch.setattr(bench, "TEAMS", (2,))
    (row,) = bench.rows()
    assert row.keys() == {"name", "value", "unit", "bar", "ratio", "ok"}
    assert row["unit"] == "rays/s"


@pytest.mark.parametrize("turned", [0.0, 0.3, pi / 2, -2.0])
def test_a_pushed_polygon_is_seen_at_its_pose(turned: float) -> None:
    """Its corners are those of a polygon that is fixed where it was pushed to."""
    thing = "world.obstacles=[{{center_m=[{x},{y}], corners_m={corners}{mass}}}]"
    corners = [(-0.2, -0.1), (0.4, -0.3), (0.5, 0.2), (-0.1, 0.3)]
    c, s = cos(turned), sin(turned)
    there = [[c * x - s * y, s * x + c * y] for x, y in corners]
    fixed = look(Pose2D(), thing.format(x=2.0, y=1.0, corners=there, mass=""))
    scenario = scene(thing.format(x=5.0, y=5.0, corners=[list(corner) for corner in corners], mass=", mass_kg=3"))
    pushed = Scanner(scenario).scan([Pose2D()], {0: Pose2D(2.0, 1.0, turned)})[0].tolist()
    assert pushed == pytest.approx(fixed)
    assert min(pushed) < 2.5


BEAK = ((-0.2, -0.1), (0.4, -0.3), (0.5, 0.2), (-0.1, 0.3))
"""Body without any symmetry."""


def test_a_robots_sides_are_those_of_its_body_turned_and_set_down_at_its_pose() -> None:
    """The same as those of an obstacle of that shape there."""
    poses = [Pose2D(2.0, 1.0, 0.6), Pose2D(-3.0, 5.0, -2.0)]
    bodies = robot_outlines(np.array([(p.x, p.y, p.theta) for p in poses]), BEAK, 0.5)
    thing = Obstacle((0.0, 0.0), corners_m=BEAK)
    circles, sides = outline((thing, pose) for pose in poses)
    assert not circles
    assert bodies.sides.ravel().tolist() == pytest.approx([number for side in sides for number in side])
    assert bodies.circles.tolist() == [[2.0, 1.0, 0.5], [-3.0, 5.0, 0.5]]


def test_round_robots_have_no_sides() -> None:
    assert robot_outlines(np.array([(1.0, 2.0, 3.0)]), (), 0.5).sides.shape == (0, 4)


@pytest.mark.parametrize("footprint", [(), BEAK])
@pytest.mark.parametrize("aside", [(1.0, 0.0), (0.0, -1.0), (0.6, 0.8)])
@pytest.mark.parametrize("origin", [(0.0, 0.0), (7.0, -4.0), (-3.0, 6.0)])
def test_a_robot_that_stands_in_anothers_place_is_not_seen_and_one_beside_it_is(
    origin: tuple[float, float], aside: tuple[float, float], footprint: tuple[tuple[float, float], ...]
) -> None:
    """Up to nine tenths of two radii; wherever they are, to whatever side."""
    lidar = Lidar(beams=360)
    for apart_m, seen in ((0.0, False), (0.17, False), (0.19, True)):
        other = (origin[0] + apart_m * aside[0], origin[1] + apart_m * aside[1], 0.0)
        poses = np.array([(*origin, 0.0), other])
        nothing = np.empty((0, 3)), np.empty((0, 4))
        ranges = cast(poses, robot_outlines(poses, footprint, 0.1), *nothing, lidar)
        assert [bool((row < inf).any()) for row in ranges] == [seen, seen], apart_m
