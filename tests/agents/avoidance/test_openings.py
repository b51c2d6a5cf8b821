"""Openings: the nearest direction in which no point bars the way, looked for in the same order as if all were asked."""

from __future__ import annotations

from math import cos, hypot, pi, sin
from random import Random

import pytest

from lfa.agents.avoidance.openings import ALL_STEPS, BESIDE, STEP_RAD, barring_point, first_open
from lfa.agents.perception.scan import Point
from lfa.protocol.geometry import wrap

REACH_M, HALF_M = 1.0, 0.3
DRAWS = 300


def bars(point: Point, bearing: float) -> bool:
    """Whether a point alone bars the way in this direction."""
    return barring_point([point], bearing, REACH_M, HALF_M) == 0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_nearest_open_direction_is_found_whatever_the_order_of_the_points(side: float) -> None:
    chance, found = Random(5), []
    for _ in range(DRAWS):
        points = [(chance.uniform(-1.5, 1.5), chance.uniform(-1.5, 1.5)) for _ in range(chance.randint(1, 14))]
        towards, first = chance.uniform(-pi, pi), chance.randint(0, 3)
        ways = [wrap(towards + side * n * STEP_RAD) for n in range(first, ALL_STEPS + 1)]
        nearest = next((way for way in ways if not any(bars(point, way) for point in points)), None)
        assert first_open(points, towards, side, first, ALL_STEPS, REACH_M, HALF_M) == nearest
        found.append(nearest)
    assert len(set(found)) > 0.5 * DRAWS, "the draws have answers of many kinds"


def test_the_last_step_is_asked_for_too_and_none_after_it() -> None:
    fan = [(cos(0.1 * n), sin(0.1 * n)) for n in range(-31, 2)]
    beyond = next(n for n in range(ALL_STEPS) if not any(bars(point, n * STEP_RAD) for point in fan))
    assert beyond > 0
    assert first_open(fan, 0.0, 1.0, 0, beyond, REACH_M, HALF_M) == pytest.approx(beyond * STEP_RAD)
    assert first_open(fan, 0.0, 1.0, 0, beyond - 1, REACH_M, HALF_M) is None


@pytest.mark.parametrize("bearing", [0.0, 0.7, -2.0])
@pytest.mark.parametrize(
    ("along_m", "across_m", "barred"),
    [
        (0.5, 0.0, True),
        (REACH_M + HALF_M - 0.01, 0.0, True),
        (REACH_M + HALF_M + 0.01, 0.0, False),
        (0.5, HALF_M - 0.01, True),
        (0.5, HALF_M + 0.01, False),
        (0.5, 0.01 - HALF_M, True),
        (0.5, -0.01 - HALF_M, False),
        (-0.1, 0.0, False),
        (1.1 * BESIDE * 0.2, 0.2, True),
        (0.9 * BESIDE * 0.2, 0.2, False),
        (1.1 * BESIDE * 0.2, -0.2, True),
        (0.9 * BESIDE * 0.2, -0.2, False),
    ],
)
def test_a_point_bars_the_way_that_the_body_sweeps_but_not_the_one_past_it(
    bearing: float, along_m: float, across_m: float, barred: bool
) -> None:
    c, s = cos(bearing), sin(bearing)
    point = (c * along_m - s * across_m, s * along_m + c * across_m)
    assert hypot(*point) == pytest.approx(hypot(along_m, across_m))
    assert bars(point, bearing) == barred


def test_the_first_point_that_bars_is_named() -> None:
    points = [(-1.0, 0.0), (0.0, 1.0), (0.5, 0.1), (0.4, 0.0)]
    assert barring_point(points, 0.0, REACH_M, HALF_M) == 2
    assert barring_point(points[:2], 0.0, REACH_M, HALF_M) is None
