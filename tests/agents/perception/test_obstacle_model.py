"""What a robot makes of its scans: what moves among what stands."""

from __future__ import annotations

from math import cos, hypot, inf, pi, sin, sqrt

import pytest
from msgspec.structs import replace

from lfa.agents.perception.obstacle_model import MATES_M, ObstacleModel
from lfa.agents.perception.shared_obstacles import SharedObstacles
from lfa.protocol.geometry import Pose2D
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import LaserScan
from lfa.protocol.messages.team import ObstacleNote
from lfa.protocol.mission import Limits

BEAMS = 360


def scan_of_post(ahead_m: float, radius_m: float, range_max_m: float) -> LaserScan:
    """Return the scan of a round post that stands ahead, by a scanner of that range."""
    ranges = []
    for n in range(BEAMS):
        angle = -pi + 2.0 * pi * n / BEAMS
        beside = ahead_m * sin(angle)
        meets = cos(angle) > 0.0 and abs(beside) < radius_m
        r = ahead_m * cos(angle) - sqrt(radius_m**2 - beside**2) if meets else inf
        ranges.append(r if r < range_max_m else inf)
    return LaserScan(Header("robot1", 1, 0, 0.0), -pi, 2.0 * pi / BEAMS, 0.05, range_max_m, tuple(ranges))


@pytest.mark.parametrize("range_max_m", [2.5, 3.5, 8.0])
def test_what_comes_into_the_range_of_a_scanner_by_and_by_does_not_move(range_max_m: float) -> None:
    """Of a post at the end of the range a robot sees more with each step that it drives towards it."""
    model = ObstacleModel(0.15, Limits(), SharedObstacles(lambda _now: ()))
    for n in range(60):
        here, now = Pose2D(0.02 * n, 0.0, 0.0), 0.1 * n
        model.see(scan_of_post(min(range_max_m, 5.0) + 0.6 - here.x, 0.45, range_max_m), here, (), now)
        assert model.moving(here, now) == [], now


@pytest.mark.parametrize("ahead_m", [4.0, 5.0, 5.2, 5.4])
@pytest.mark.parametrize("radius_m", [0.1, 0.3, 0.49])
@pytest.mark.parametrize("bearing", [-0.1, 0.0, 0.1])
def test_a_team_mate_beyond_the_distance_asked_for_changes_nothing_of_what_a_scan_shows(
    ahead_m: float, radius_m: float, bearing: float
) -> None:
    """So a robot need not ask where those are that drive farther off."""
    mate = Pose2D(MATES_M * cos(bearing), MATES_M * sin(bearing), 0.0)
    shown = []
    for mates in ((), (mate,)):
        model = ObstacleModel(0.15, Limits(), SharedObstacles(lambda _now: ()))
        model.see(scan_of_post(ahead_m, radius_m, 8.0), Pose2D(), mates, 1.0)
        shown.append([model.nearest(Pose2D(), kind, 1.0) for kind in ("stationary", "wall")])
    assert shown[0] == shown[1]


def scan_of_end(beside_m: float) -> LaserScan:
    """Return the scan of the end of a wall that lies across the way, 1 m ahead, to `beside_m` on the left."""
    ranges = []
    for n in range(BEAMS):
        angle = -pi + 2.0 * pi * n / BEAMS
        meets = cos(angle) > 0.0 and -3.0 < sin(angle) / cos(angle) < beside_m
        ranges.append(1.0 / cos(angle) if meets else inf)
    return LaserScan(Header("robot1", 1, 0, 0.0), -pi, 2.0 * pi / BEAMS, 0.05, 8.0, tuple(ranges))


@pytest.mark.parametrize(("jumps", "moves"), [(1, False), (0, True)])
def test_a_wall_that_lies_elsewhere_since_the_pose_has_jumped_does_not_move(jumps: int, moves: bool) -> None:
    model = ObstacleModel(0.15, Limits(), SharedObstacles(lambda _now: ()))
    moved = False
    for n in range(20):
        here, now = Pose2D(0.0, 0.15 if n >= 10 else 0.0, 0.0), 0.1 * n
        model.see(scan_of_end(0.0), here, (), now, jumps if n >= 10 else 0)
        moved = moved or model.moving(here, now) != []
    assert moved is moves


@pytest.mark.parametrize(("beams", "remains"), [(BEAMS, False), (BEAMS // 4, True)])
def test_what_another_robot_told_of_remains_only_where_no_beam_looks_through_its_place(
    beams: int, remains: bool
) -> None:
    """A scanner that looks back only, a quarter turn from behind on, says nothing of what is ahead."""
    shared = SharedObstacles(lambda _now: ())
    shared.update(2, ObstacleNote(Header("robot2", 1, 0, 0.0), "moving", 1.5, 0.0, 0.2, (0.1, 0.0)), 0.0)
    model, scan = ObstacleModel(0.15, Limits(), shared), scan_of_post(3.0, 0.3, 8.0)
    model.see(replace(scan, ranges_m=scan.ranges_m[:beams]), Pose2D(), (), 0.2)
    assert bool(model.moving(Pose2D(), 0.2)) is remains


def test_what_was_close_behind_is_still_there_where_the_pose_jumps() -> None:
    """The scanner looks ahead, and a fix puts the robot 2 m aside, to where no beam of it shows what it had passed."""
    model, there = ObstacleModel(0.15, Limits(), SharedObstacles(lambda _now: ())), Pose2D(1.0, 2.0, -pi / 2)
    post, ahead = scan_of_post(0.6, 0.2, 8.0), replace(scan_of_post(9.0, 0.2, 8.0), ranges_m=(inf,) * (BEAMS // 2))
    half = replace(post, angle_min=-pi / 2, ranges_m=post.ranges_m[BEAMS // 4 : 3 * BEAMS // 4])
    model.see(half, Pose2D(), (), 0.0)
    before_m = min(hypot(x, y) for x, y in model.points(Pose2D()))
    model.see(replace(ahead, angle_min=pi / 2), there, (), 0.1, jumps=1)
    assert min((hypot(x, y) for x, y in model.points(there)), default=inf) == pytest.approx(before_m, abs=0.01)
