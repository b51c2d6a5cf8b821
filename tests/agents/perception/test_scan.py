"""From a scan to what stands in the way."""

from math import atan2, hypot, inf, nan, pi, sin, tan

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from msgspec.structs import replace

from lfa.agents.perception.scan import KEPT_M, KEPT_S, SIGHT_M, Surroundings, free_along, without
from lfa.protocol.geometry import Pose2D, Twist, along_arc
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import LaserScan

HEADER = Header("robot1", 1, 0, 0.0)


def scan(*ranges: float) -> LaserScan:
    return LaserScan(HEADER, 0.0, pi / 2, 0.05, 8.0, ranges)


def test_points_stay_where_they_are_while_the_robot_moves_on() -> None:
    seen = Surroundings()
    seen.scan(scan(2.0, inf, inf, inf), Pose2D(1.0, 0.0, 0.0), 0.0)
    [(x, y)] = seen.points(Pose2D(2.0, 0.0, pi / 2))
    assert abs(x) < 1e-9
    assert abs(y + 1.0) < 1e-9


def test_out_of_range_too_near_and_bad_beams_are_no_points() -> None:
    seen = Surroundings()
    seen.scan(scan(inf, -inf, nan, SIGHT_M + 1.0), Pose2D(), 0.0)
    assert seen.points(Pose2D()) == []


def test_what_has_come_too_near_to_be_measured_is_still_there() -> None:
    """Until its beam sees past it. A filter may hide the robot's own parts as too near: nothing was seen there."""
    for turn in (1.0, -1.0):
        seen, near = Surroundings(), replace(scan(1.0, inf, inf, inf), range_min_m=0.5, angle_increment=turn * pi / 2)
        seen.scan(near, Pose2D(), 0.0)
        seen.scan(replace(near, ranges_m=(0.52, -inf, inf, inf)), Pose2D(0.48, 0.0, 0.0), 0.1)
        for n in (1, 2):
            seen.scan(replace(near, ranges_m=(-inf, -inf, inf, inf)), Pose2D(0.5 + 0.1 * n, 0.0, 0.0), 0.1 + 0.1 * n)
            assert [(round(x, 9), round(y, 9)) for x, y in seen.points_map] == [(1.0, 0.0)]
        seen.scan(replace(near, ranges_m=(3.0, -inf, inf, inf)), Pose2D(0.7, 0.0, 0.0), 0.4)
        assert [(round(x, 9), round(y, 9)) for x, y in seen.points_map] == [(3.7, 0.0)]


def test_a_scanner_looks_at_what_is_in_the_direction_of_one_of_its_beams() -> None:
    """Three of a quarter turn, from ahead to behind over the left, and one that failed: the robot looks along y."""
    seen = Surroundings()
    assert not seen.looks_at((0.0, 5.0))
    seen.scan(replace(scan(inf, nan, 2.0)), Pose2D(1.0, 0.0, pi / 2), 0.0)
    assert [seen.looks_at(place) for place in ((1.0, 3.0), (-2.0, 0.0), (1.0, -3.0), (4.0, 0.0))] == [
        True, False, True, False,
    ]  # fmt: skip


def test_it_does_not_look_past_what_is_too_near_to_be_measured() -> None:
    seen = Surroundings()
    for near in (-inf, 0.04):
        seen.scan(scan(near, inf, 2.0, inf), Pose2D(), 0.0)
        assert [seen.looks_at(place) for place in ((3.0, 0.0), (0.0, 3.0))] == [False, True]


def test_a_range_of_zero_is_no_point_whatever_the_scanners_minimum_says() -> None:
    seen = Surroundings()
    seen.scan(replace(scan(0.0, 0.04, 1.0, inf), range_min_m=0.0), Pose2D(), 0.0)
    assert len(seen.points(Pose2D())) == 1


def test_a_known_team_mate_is_left_out() -> None:
    assert without([(1.0, 0.0), (1.0, 0.5)], (1.0, 0.0), 0.3) == [(1.0, 0.5)]


def test_the_way_straight_ahead_ends_at_the_bodys_edge() -> None:
    assert free_along([(1.0, 0.0)], Twist(0.5, 0.0), 0.2) == 0.8
    assert free_along([(1.0, 0.21)], Twist(0.5, 0.0), 0.2) == inf
    assert free_along([(-1.0, 0.0)], Twist(0.5, 0.0), 0.2) == inf
    assert free_along([(-1.0, 0.0)], Twist(-0.5, 0.0), 0.2) == 0.8


@given(
    st.floats(-2.0, 2.0),
    st.floats(-2.0, 2.0),
    st.floats(0.1, 1.0),
    st.floats(-1.0, 1.0).filter(lambda w: abs(w) > 0.05),
)
def test_no_body_that_stays_within_the_free_way_touches_the_point(x: float, y: float, v: float, omega: float) -> None:
    """Against small steps along the arc; a point inside the body at the start is another matter."""
    half_width = 0.2
    if hypot(x, y) < half_width + 0.01:
        return
    free_m = free_along([(x, y)], Twist(v, omega), half_width)
    duration = min(free_m, 2.0 * pi * v / abs(omega), 6.0) / v
    for n in range(201):
        pose = along_arc(Pose2D(), Twist(v, omega), duration * n / 200)
        assert hypot(x - pose.x, y - pose.y) > half_width - 0.06, f"touched after {n / 2} % of {free_m:.3f} m"


def test_a_point_that_was_passed_does_not_bar_a_bend() -> None:
    beside = (0.0, -0.19)
    assert free_along([beside], Twist(0.5, 0.5), 0.2) > 0.5


def test_the_smallest_of_speeds_straight_ahead_is_straight() -> None:
    assert free_along([(1.0, 0.0)], Twist(5e-324, 0.0), 0.2) == 0.8


@given(st.lists(st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)), max_size=20), st.floats(-9.0, 9.0))
def test_points_beyond_a_limit_of_the_free_way_do_not_change_it(points: list[tuple[float, float]], bend: float) -> None:
    for arc in (Twist(1.0, bend), Twist(-1.0, bend)):
        assert free_along(points, arc, 0.2, 0.9) == min(free_along(points, arc, 0.2), 0.9)


@example([(1.0, 0.24), (1.1, 0.06)], 0.1)  # the farther one is met first: the nearer one at the side only
@given(st.lists(st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)), max_size=20), st.floats(-9.0, 9.0))
def test_the_free_way_among_points_ends_at_the_first_of_them(points: list[tuple[float, float]], bend: float) -> None:
    arc = Twist(0.5, 0.5 * bend)
    assert free_along(points, arc, 0.2) == min((free_along([point], arc, 0.2) for point in points), default=inf)


BEHIND = scan(inf, inf, 0.5, inf)
BLIND_BEHIND = scan(inf, inf, nan, inf)


def test_a_polygon_remembers_what_is_close_where_its_scanner_does_not_look() -> None:
    seen = Surroundings(remembers=True)
    seen.scan(BEHIND, Pose2D(), 0.0)
    seen.scan(BLIND_BEHIND, Pose2D(0.1, 0.0, 0.0), 0.1)
    [(x, y)] = seen.points(Pose2D(0.1, 0.0, 0.0))
    assert abs(x + 0.6) < 1e-9
    assert abs(y) < 1e-9


def test_what_a_beam_looks_through_is_not_remembered() -> None:
    seen = Surroundings(remembers=True)
    seen.scan(BEHIND, Pose2D(), 0.0)
    seen.scan(scan(inf, inf, inf, inf), Pose2D(), 0.1)
    assert seen.points(Pose2D()) == []


@pytest.mark.parametrize(("angle_min", "step"), [(0.0, -pi / 2), (-pi, pi / 2), (1e-9, pi / 2), (1.0, -pi / 2)])
def test_what_a_beam_looks_through_is_not_remembered_whichever_way_the_scanner_turns(
    angle_min: float, step: float
) -> None:
    seen = Surroundings(remembers=True)
    seen.scan(LaserScan(HEADER, angle_min, step, 0.05, 8.0, (0.5, 0.5, 0.5, 0.5)), Pose2D(), 0.0)
    seen.scan(LaserScan(HEADER, angle_min, step, 0.05, 8.0, (inf, inf, inf, inf)), Pose2D(0.0, 0.0, 1e-6), 0.1)
    assert seen.points(Pose2D()) == []


def test_what_is_far_or_was_seen_long_ago_is_not_remembered() -> None:
    seen = Surroundings(remembers=True)
    seen.scan(BEHIND, Pose2D(), 0.0)
    seen.scan(BLIND_BEHIND, Pose2D(KEPT_M, 0.0, 0.0), 0.1)
    assert seen.points(Pose2D()) == []
    seen.scan(BEHIND, Pose2D(), 1.0)
    seen.scan(BLIND_BEHIND, Pose2D(), 1.1)
    seen.scan(BLIND_BEHIND, Pose2D(), 1.1 + KEPT_S)
    assert seen.points(Pose2D()) == []


def test_a_round_robot_whose_scanner_looks_all_round_knows_its_newest_scan_only() -> None:
    seen = Surroundings()
    seen.scan(BEHIND, Pose2D(), 0.0)
    seen.scan(BLIND_BEHIND, Pose2D(), 0.1)
    assert seen.points(Pose2D()) == []


@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_what_a_coarse_scan_shows_ends_half_a_beam_beside_the_last_reading(turn: float) -> None:
    step, seen = 0.1, Surroundings()
    coarse = LaserScan(HEADER, -turn * 0.2, turn * step, 0.05, 8.0, (inf, 1.0, 1.0, 3.0, inf))
    seen.scan(coarse, Pose2D(), 0.0)
    bearings = sorted(round(atan2(y, x) * turn / step, 6) for x, y in seen.points(Pose2D()) if hypot(x, y) < 1.01)
    assert bearings == [-1.5, -1.0, 0.0, 0.5]


def test_a_fine_scan_has_points_only_where_beams_end() -> None:
    seen = Surroundings()
    seen.scan(LaserScan(HEADER, 0.0, pi / 90, 0.05, 8.0, (inf, 1.0, inf)), Pose2D(), 0.0)
    assert len(seen.points(Pose2D())) == 1


def half_scan(behind_m: float, ahead_m: float = inf) -> tuple[LaserScan, LaserScan]:
    """A scanner that sees half of the turn, towards something `behind_m` away, and turned away from that."""
    step = pi / 90
    there = LaserScan(HEADER, -pi / 2, step, 0.05, 8.0, tuple(behind_m if n == 45 else inf for n in range(91)))
    return there, replace(there, ranges_m=tuple(ahead_m for _ in range(91)))


def test_a_round_robot_whose_scanner_looks_ahead_remembers_what_is_close_behind_it() -> None:
    """It turned, and reversed into what it had faced."""
    seen, (there, away) = Surroundings(), half_scan(0.5)
    seen.scan(there, Pose2D(), 0.0)
    seen.scan(away, Pose2D(0.0, 0.0, pi), 0.1)
    [(x, y)] = seen.points(Pose2D(0.0, 0.0, pi))
    assert (x, y) == (pytest.approx(-0.5), pytest.approx(0.0, abs=1e-9))


def test_a_team_mate_is_not_remembered_where_it_was() -> None:
    seen, (there, away) = Surroundings(), half_scan(0.5)
    seen.scan(there, Pose2D(), 0.0)
    seen.scan(away, Pose2D(0.0, 0.0, pi), 0.1, [(0.6, 0.0)], 0.2)
    assert seen.points(Pose2D(0.0, 0.0, pi)) == []


@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_a_wall_that_coarse_beams_meet_aslant_has_no_edges_but_its_ends(turn: float) -> None:
    """Half a beam beside each reading it seemed 8 cm nearer: a corridor of 0.7 m seemed shut."""
    step, beside_m, end_m = pi / 30, 0.35, 4.0
    bearings = [(n + 0.5) * step for n in range(30)]
    ranges = [beside_m / sin(b) if 0.0 < beside_m / tan(b) < end_m else inf for b in bearings]
    seen = Surroundings()
    seen.scan(LaserScan(HEADER, turn * bearings[0], turn * step, 0.05, 8.0, tuple(ranges)), Pose2D(), 0.0)
    points = sorted(seen.points(Pose2D()))
    off_wall = [x for x, y in points if abs(abs(y) - beside_m) > 1e-6]
    assert all(abs(x) < 0.1 or x > 3.0 for x in off_wall)
    assert len(off_wall) <= 2
