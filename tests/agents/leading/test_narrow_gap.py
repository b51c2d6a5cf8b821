"""Gaps that only a column passes are seen ahead on the route; what stands on one side alone is none."""

from lfa.agents.leading.narrow_gap import narrow_gap_m
from lfa.agents.perception.scan import Point

RADIUS_M = 0.15


def ahead(s: float) -> Point:
    return s, 0.0


def wall(x: float, side: float, from_m: float) -> list[Point]:
    return [(x, side * (from_m + 0.1 * n)) for n in range(12)]


def test_a_door_ahead_is_a_narrow_gap_of_its_width() -> None:
    assert narrow_gap_m(wall(1.5, 1.0, 0.4) + wall(1.5, -1.0, 0.3), ahead, RADIUS_M) == 0.7


def test_a_wide_door_is_none() -> None:
    assert narrow_gap_m(wall(1.5, 1.0, 0.8) + wall(1.5, -1.0, 0.8), ahead, RADIUS_M) is None


def test_an_obstacle_on_one_side_is_none() -> None:
    assert narrow_gap_m(wall(1.5, 1.0, 0.2), ahead, RADIUS_M) is None


def test_two_obstacles_one_behind_the_other_are_none() -> None:
    assert narrow_gap_m(wall(1.0, 1.0, 0.3) + wall(2.2, -1.0, 0.3), ahead, RADIUS_M) is None


def test_an_obstacle_on_the_route_is_none() -> None:
    assert narrow_gap_m(wall(1.5, 1.0, 0.0) + wall(1.5, -1.0, 0.05), ahead, RADIUS_M) is None, "no body passes it"


def test_a_gap_behind_the_robot_is_none() -> None:
    assert narrow_gap_m(wall(-0.5, 1.0, 0.3) + wall(-0.5, -1.0, 0.3), ahead, RADIUS_M) is None
