"""A follower that has lost its slot and wins nothing plans a way to it; a slot that is taken has a place beside it."""

from __future__ import annotations

from math import cos, hypot, inf, pi, sin

import pytest

from lfa.agents.leading.free_place import TAKEN_S
from lfa.agents.leading.free_slot import HIDDEN_S, FreeSlot
from lfa.agents.leading.way_back import BACK_M, CLOSE_M, OUT_M, PATIENCE_S, WayBack
from lfa.protocol.geometry import STILL, Point, Pose2D, along_arc
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import LaserScan
from lfa.protocol.mission import Leading, Mission

MISSION = Mission(robots=(1, 2), leading=Leading(route_m=((0.0, 0.0), (9.0, 0.0))))
WALL_X, WALL_Y = 2.0, 1.2
"""A wall across the way at x = 2 m, from y = -1.2 m to 1.2 m."""
SLOT = (4.0, 0.0)


def begun(mapping_s: float = 0.0) -> WayBack:
    back = WayBack(MISSION)
    for n in range(round(PATIENCE_S) + 2):
        back.watch(SLOT, Pose2D(), True, None, mapping_s + float(n))
    assert back.way is not None
    return back


def test_a_follower_out_of_its_slot_that_wins_nothing_plans_a_way() -> None:
    begun()


@pytest.mark.parametrize(
    ("slot", "hindered", "wins"), [((0.9 * OUT_M, 0.0), True, 0.0), (SLOT, False, 0.0), (SLOT, True, 0.3)]
)
def test_one_in_its_slot_or_on_its_way_plans_none(slot: Point, hindered: bool, wins: float) -> None:
    back = WayBack(MISSION)
    for n in range(3 * round(PATIENCE_S)):
        back.watch(slot, Pose2D(0.5 * wins * n - 3.0 if wins else 0.0), hindered, None, 0.5 * n)
    assert back.way is None


def scan_of_wall(pose: Pose2D) -> LaserScan:
    """The wall as a scanner at `pose` sees it, in 180 beams."""
    ranges = []
    for n in range(180):
        angle = pose.theta - pi + n * pi / 90
        r = (WALL_X - pose.x) / cos(angle) if abs(cos(angle)) > 1e-6 else inf
        ranges.append(r if 0.0 < r < 8.0 and abs(pose.y + r * sin(angle)) < WALL_Y else inf)
    return LaserScan(Header("robot2", 1, 1, 0.0), -pi, pi / 90, 0.05, 8.0, tuple(ranges))


def test_the_way_leads_round_a_wall_and_ends_at_the_slot() -> None:
    back, pose, twist, crossed_y, now = begun(-20.0), Pose2D(), STILL, None, 0.0
    while back.way is not None and now < 40.0:
        scan = scan_of_wall(pose)
        if round(now / 0.02) % 5 == 0:
            back.see(scan, pose, twist, [])
        points = [(r * cos(a), r * sin(a)) for n, r in enumerate(scan.ranges_m) if r < 2.5 for a in [-pi + n * pi / 90]]
        wanted = back.steer(points, pose, SLOT, lambda _: [], twist, now)
        if wanted is None:
            break
        twist, before = wanted, pose
        pose = along_arc(pose, twist, 0.02)
        if before.x < WALL_X <= pose.x:
            crossed_y = pose.y
        now += 0.02
    assert crossed_y is not None
    assert abs(crossed_y) > WALL_Y + 0.1, "it drove round the end of the wall"
    assert hypot(pose.x - SLOT[0], pose.y - SLOT[1]) <= BACK_M


def body(pose: Pose2D, x: float, y: float, radius_m: float = 0.3) -> list[Point]:
    """The near side of a round thing at (x, y) in `map`, in `base_link` of `pose`."""
    apart, angles = hypot(x - pose.x, y - pose.y), [pi + k * pi / 40 for k in range(-20, 21)]
    return [(apart + radius_m * cos(a), radius_m * sin(a)) for a in angles]


def test_a_follower_whose_slot_is_taken_stands_beside_it_and_circles_no_longer() -> None:
    free, pose, now = FreeSlot(0.15), Pose2D(3.0, 0.0, 0.0), 0.0
    seen_inside_s = TAKEN_S + HIDDEN_S
    while now < seen_inside_s + 10.0:
        twist = free.steer(SLOT, body(pose, *SLOT), pose, 0.0, 0.7, now)
        assert abs(now - seen_inside_s) < 0.03 or (twist is None) == (now < seen_inside_s)
        pose = along_arc(pose, twist or STILL, 0.02)
        now += 0.02
    assert twist == STILL
    assert 0.45 < SLOT[0] - pose.x < 0.65
    assert free.steer((5.0, 0.0), body(pose, *SLOT), pose, 0.0, 0.7, now) is None, "the slot has moved on"
    assert free.steer(SLOT, body(pose, *SLOT), pose, 0.4, 0.7, now) is None, "the predecessor drives on"


def test_a_slot_that_is_free_is_left_to_the_follower() -> None:
    free = FreeSlot(0.15)
    for n in range(10):
        assert free.steer(SLOT, [(0.5, 2.0)], Pose2D(3.0, 0.0, 0.0), 0.0, 0.7, float(n)) is None
    assert free.steer(SLOT, [], Pose2D(3.0, 0.0, 0.0), 0.0, 0.7, 10.0) is None


def test_a_way_back_ends_close_to_a_slot_that_something_stands_beside() -> None:
    """Nothing can lie between; it dithered there before a wall, to the run's end."""
    back, pose = begun(-20.0), Pose2D(SLOT[0] - 0.9 * CLOSE_M, 0.0, 0.0)
    wall = [(0.9 * CLOSE_M + 0.1, 0.05 * n) for n in range(-20, 21)]
    assert back.steer(wall, pose, SLOT, lambda _: [], STILL, 0.0) is None
    assert back.way is None


def test_it_goes_on_where_something_stands_between_the_follower_and_its_slot() -> None:
    back, pose = begun(-20.0), Pose2D(SLOT[0] - 0.9 * BACK_M, 0.0, 0.0)
    wall = [(0.5 * BACK_M, 0.05 * n) for n in range(-20, 21)]
    back.steer(wall, pose, SLOT, lambda _: [], STILL, 0.0)
    assert back.way is not None


def test_it_ends_near_a_slot_that_a_team_mate_stands_on() -> None:
    back, pose = begun(-20.0), Pose2D(SLOT[0] - 0.9 * BACK_M, 0.0, 0.0)
    mate = [(0.9 * BACK_M - 0.15 + 0.05 * abs(n), 0.05 * n) for n in range(-3, 4)]
    assert back.steer(mate, pose, SLOT, lambda _: [Pose2D(*SLOT, 0.0)], STILL, 0.0) is None
    assert back.way is None
