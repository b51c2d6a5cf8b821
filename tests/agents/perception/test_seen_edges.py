"""What a robot knows of the end of a thin wall that none of its beams meets any more."""

from __future__ import annotations

from math import cos, hypot, inf, pi, sin

import pytest

from lfa.agents.perception.obstacle_model import ObstacleModel
from lfa.agents.perception.seen_edges import KEPT_S
from lfa.agents.perception.shared_obstacles import SharedObstacles
from lfa.protocol.geometry import Pose2D
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import LaserScan
from lfa.protocol.mission import Limits

BEAMS, RADIUS_M = 180, 0.15
END_M = 0.25
"""Place [m] on the y axis, in `map`, at which a wall begins that is as thin as a line, and goes on along that axis."""


def scan(pose: Pose2D, *, wall: bool = True) -> LaserScan:
    ranges = []
    for n in range(BEAMS):
        angle = 2.0 * pi * n / BEAMS - pi
        far_m = -pose.x / cos(angle + pose.theta)
        meets = wall and far_m > 0.0 and pose.y + far_m * sin(angle + pose.theta) >= END_M
        ranges.append(far_m if meets else inf)
    return LaserScan(Header("robot1", 1, 0, 0.0), -pi, 2.0 * pi / BEAMS, 0.05, 8.0, tuple(ranges))


def model() -> ObstacleModel:
    return ObstacleModel(RADIUS_M, Limits(), SharedObstacles(lambda _now: ()))


def nearest_m(seen: ObstacleModel, pose: Pose2D) -> float:
    return min((hypot(x, y) for x, y in seen.points(pose)), default=inf)


def passed(mps: float, to_m: float = 0.0, hz: float = 10.0) -> tuple[ObstacleModel, Pose2D, float]:
    """A robot that drives past the end of the wall, as far as `to_m` beyond the line of it."""
    seen, x, now = model(), -0.3, 0.0
    while x < to_m - 1e-6:
        x, now = min(x + mps / hz, to_m), now + 1.0 / hz
        seen.see(scan(Pose2D(x)), Pose2D(x), (), now)
    return seen, Pose2D(to_m), now


@pytest.mark.parametrize("to_m", [0.0, 0.01, 0.02, 0.03])
def test_the_end_of_a_thin_wall_abeam_is_known_although_no_beam_meets_it(to_m: float) -> None:
    alone = model()
    alone.see(scan(Pose2D(to_m)), Pose2D(to_m), (), 0.0)
    seen, pose, _ = passed(0.2, to_m)
    assert nearest_m(alone, pose) > END_M + 0.02
    assert nearest_m(seen, pose) < END_M + 0.01


@pytest.mark.parametrize(("mps", "hz"), [(0.06, 10.0), (0.3, 40.0)])
def test_it_is_known_to_a_robot_that_creeps_and_with_a_fast_scanner(mps: float, hz: float) -> None:
    """From scan to scan it moves by less than a centimetre."""
    seen, pose, _ = passed(mps, hz=hz)
    assert nearest_m(seen, pose) < END_M + 0.01


def test_what_only_the_earlier_of_two_scans_from_one_place_shows_has_gone() -> None:
    seen, pose, now = passed(0.2, -0.1)
    assert nearest_m(seen, pose) < 0.3
    seen.see(scan(pose), pose, (), now + 0.1)
    for n in range(4):
        seen.see(scan(pose, wall=False), pose, (), now + 0.2 + 0.1 * n)
    gone = [point for point in seen.points(pose) if hypot(*point) < hypot(0.1, END_M) + 0.005]
    assert gone == []


def test_an_edge_that_no_scan_shows_any_more_is_forgotten_after_a_time() -> None:
    seen, pose, now = passed(0.2)
    for n in range(1, 2 + round(KEPT_S / 0.1)):
        seen.see(scan(pose, wall=False), Pose2D(0.011 * (n % 2)), (), now + 0.1 * n)
    assert seen.points(pose) == []


def test_of_a_team_mate_that_has_driven_on_nothing_is_kept() -> None:
    seen, there = model(), Pose2D(0.1, END_M + 0.1)
    seen.see(scan(Pose2D(-0.1)), Pose2D(-0.1), [there], 0.0)
    seen.see(scan(Pose2D(), wall=False), Pose2D(), [there], 0.1)
    assert [point for point in seen.points(Pose2D()) if hypot(*point) < END_M + 0.1] == []


def test_nothing_is_kept_of_a_wall_that_the_newest_scan_shows() -> None:
    """Noise would make it come nearer with each scan."""
    seen = model()
    for n in range(10):
        pose = Pose2D(-0.4 + 0.02 * n, 1.5)
        seen.see(scan(pose), pose, (), 0.1 * n)
    points = seen.points(pose)
    assert len(points) == len({(round(x, 6), round(y, 6)) for x, y in points})
    assert len(points) == sum(r < 2.0 for r in scan(pose).ranges_m)


def test_where_the_map_has_moved_edges_are_forgotten() -> None:
    seen, pose, now = passed(0.2)
    seen.see(scan(pose), pose, (), now + 0.1, jumps=1)
    assert nearest_m(seen, pose) > END_M + 0.02
