"""A passage narrower than a polygon's circle is found by its middle line, whatever the route to it."""

from __future__ import annotations

from math import cos, pi, sin

import pytest

from lfa.agents.avoidance.passage import passage
from lfa.agents.perception.scan import Point
from lfa.protocol.geometry import Pose2D, compose, in_base

HALF_M, LEAST_M, NARROW_M = 0.265, 0.43, 0.76


def gap(half_m: float = HALF_M, deep_m: float = 0.0) -> list[Point]:
    """Return the points in `map` of a wall across x = 1.5 with a gap about y = 0."""
    wall = [(1.5, side * (half_m + 0.03 * n)) for n in range(30) for side in (1.0, -1.0)]
    return wall + [(1.5 + 0.03 * n, side * half_m) for n in range(round(deep_m / 0.03)) for side in (1.0, -1.0)]


def seen(walls: list[Point], pose: Pose2D) -> Pose2D | None:
    """Return the passage in `map` that a robot at `pose` sees on its route, which leads straight through the gap."""
    points = [in_base(pose, point) for point in walls]
    x, y = in_base(pose, (1.5, 0.04))
    far_m = (x * x + y * y) ** 0.5
    found = passage(points, lambda s: (s * x / far_m, s * y / far_m), LEAST_M, NARROW_M)
    return None if found is None else compose(pose, found)


@pytest.mark.parametrize("deep_m", [0.0, 0.3])
@pytest.mark.parametrize("aside_m", [0.0, 0.4, -0.5])
@pytest.mark.parametrize("theta", [0.0, 0.5, -0.8])
def test_the_middle_line_of_a_gap_is_square_to_it_from_wherever_it_is_seen(
    aside_m: float, theta: float, deep_m: float
) -> None:
    middle = seen(gap(deep_m=deep_m), Pose2D(0.2, aside_m, theta))
    assert middle is not None
    beside_m = (middle.x - 1.5) * -sin(middle.theta) + middle.y * cos(middle.theta)
    assert beside_m == pytest.approx(0.0, abs=0.03)
    assert abs(middle.theta) < 0.06


@pytest.mark.parametrize(("half_m", "found"), [(0.20, False), (0.23, True), (0.37, True), (0.40, False)])
def test_what_no_body_passes_and_what_its_circle_passes_is_no_passage(half_m: float, found: bool) -> None:
    assert (seen(gap(half_m), Pose2D()) is not None) is found


def test_between_the_beams_that_fall_on_a_wall_there_is_no_passage() -> None:
    wall = [(1.5, 0.1 * n + 0.05) for n in range(-12, 12)]
    assert seen(wall, Pose2D(0.0, 0.0, pi / 8)) is None


def test_beyond_the_end_of_a_route_there_is_no_passage() -> None:
    points = [in_base(Pose2D(), point) for point in gap()]
    assert passage(points, lambda s: (min(s, 0.8), 0.0), LEAST_M, NARROW_M) is None
