"""A ROS scan as a scan of the base: mount, direction of rotation, bad readings."""

from __future__ import annotations

from math import cos, hypot, inf, isfinite, isinf, isnan, nan, pi, sin
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfa.deploy.robot.ros_scan import BEAMS_MAX, converted
from lfa.deploy.ros.types import kind
from lfa.protocol.errors import Refused
from lfa.protocol.geometry import Pose2D
from tests.rigs.ros_values import header

TURN = 2.0 * pi


def scan(
    ranges: list[float], first: float = -pi, step: float | None = None, low: float = 0.1, high: float = 10.0
) -> Any:
    values = np.array(ranges, dtype=np.float32)
    step = TURN / len(ranges) if step is None else step
    head = header(0, "laser")
    return kind("sensor_msgs/msg/LaserScan")(head, first, first, step, 0.0, 0.1, low, high, values, values[:0])


def points(made: Any) -> list[tuple[float, float]]:
    angles = [made.angle_min + n * made.angle_increment for n in range(len(made.ranges_m))]
    return [(r * cos(a), r * sin(a)) for a, r in zip(angles, made.ranges_m, strict=True) if isfinite(r)]


def test_a_scanner_turned_by_a_quarter_sees_a_wall_ahead_ahead() -> None:
    """A TurtleBot 4's is: without its mount everything would be 90 degrees wrong."""
    ranges = [5.0] * 360
    ranges[90] = 1.0  # at -pi/2 of the scanner
    (x, y), *_ = [p for p in points(converted(scan(ranges), Pose2D(0.0, 0.0, pi / 2))) if hypot(*p) < 2.0]
    assert (x, y) == pytest.approx((1.0, 0.0), abs=1e-6)


@pytest.mark.parametrize("mount", [Pose2D(), Pose2D(-0.2, 0.1, 0.5)])
def test_a_scanner_that_turns_clockwise_sees_the_same(mount: Pose2D) -> None:
    ranges = [1.0 + 0.01 * n for n in range(360)]
    one = converted(scan(ranges, -pi, TURN / 360), mount)
    other = converted(scan(ranges[::-1], -pi + 359 * TURN / 360, -TURN / 360), mount)
    assert one.angle_increment == pytest.approx(other.angle_increment)
    assert np.allclose(points(one), points(other), atol=1e-4)


def test_bad_readings_are_told_from_those_out_of_range() -> None:
    made = converted(scan([nan, 0.0, 0.05, 20.0, inf, -inf, 2.0]), Pose2D())
    assert [isnan(r) for r in made.ranges_m[:2]] == [True, True]
    assert made.ranges_m[2] == -inf
    assert made.ranges_m[3:5] == (inf, inf)
    assert made.ranges_m[5:] == (-inf, 2.0)


@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(0.6, 8.0))
def test_a_body_is_where_it_is_whatever_the_mount(x: float, y: float, yaw: float, bearing: float, far: float) -> None:
    count = 720
    ranges = [inf] * count
    beam = int((bearing + pi) / TURN * count) % count
    ranges[beam] = far
    angle = -pi + beam * TURN / count + yaw
    true = (x + far * cos(angle), y + far * sin(angle))
    (seen,) = points(converted(scan(ranges, high=10.0), Pose2D(x, y, yaw)))
    assert seen == pytest.approx(true, abs=far * TURN / count + 1e-3)


def test_of_more_beams_than_are_passed_on_the_nearest_readings_are_kept() -> None:
    ranges = [5.0] * 5000
    ranges[1234] = 1.0
    made = converted(scan(ranges), Pose2D())
    assert len(made.ranges_m) == BEAMS_MAX
    assert min(made.ranges_m) == 1.0


@pytest.mark.parametrize(
    "bad", [scan([1.0], step=0.0), scan([1.0], step=nan), scan([1.0], step=1e-320),
            scan([1.0], high=nan), scan([1.0], low=5.0, high=1.0),
            scan([1.0], first=inf), scan([], step=0.1)],
)  # fmt: skip
def test_what_describes_no_scan_is_refused(bad: Any) -> None:
    with pytest.raises(Refused, match="beams from"):
        converted(bad, Pose2D())


@given(st.lists(st.floats(width=32), max_size=50), st.floats(), st.floats(), st.floats(), st.floats())
def test_any_numbers_are_a_scan_or_refused(
    ranges: list[float], first: float, step: float, low: float, high: float
) -> None:
    try:
        made = converted(scan(ranges, first, step, low, high), Pose2D(0.1, 0.0, 0.3))
    except Refused:
        return
    assert made.angle_increment > 0.0
    assert not any(isinf(x) for x in (made.angle_min, made.angle_increment))
    assert len(made.ranges_m) <= BEAMS_MAX
