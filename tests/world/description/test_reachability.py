"""What of a route is refused because walls part it from the start, and what is not."""

from __future__ import annotations

import pytest

from lfa.world.description.reachability import Segment, parted

ROUTE = [(0.0, 0.0), (10.0, 0.0)]


def box(x1: float, y1: float, x2: float, y2: float) -> list[Segment]:
    return [(x1, y1, x2, y1), (x2, y1, x2, y2), (x2, y2, x1, y2), (x1, y2, x1, y1)]


def two_rooms(gap_m: float, at_m: float = 0.0) -> list[Segment]:
    """Return a closed room with a wall across it, which has one gap of `gap_m` at `at_m`."""
    low, high = at_m - 0.5 * gap_m, at_m + 0.5 * gap_m
    return [*box(-2.0, -4.0, 12.0, 4.0), (5.0, -4.0, 5.0, low), (5.0, high, 5.0, 4.0)]


@pytest.mark.parametrize("at_m", [0.0, 1.33])
@pytest.mark.parametrize("radius_m", [0.05, 0.15, 0.333, 0.5])
def test_a_gap_is_passed_from_two_centimetres_beside_the_body_on_and_bars_five_below_it(
    radius_m: float, at_m: float
) -> None:
    """On the route, which no wall crosses then, and beside it."""
    assert parted(ROUTE, two_rooms(2.0 * radius_m + 0.04, at_m), radius_m) is None
    assert parted(ROUTE, two_rooms(2.0 * radius_m - 0.05, at_m), radius_m) == ROUTE[-1]


def test_a_way_point_in_a_closed_cell_is_named_though_the_goal_can_be_reached() -> None:
    walled_in = (5.0, 0.0)
    assert parted([ROUTE[0], walled_in, ROUTE[1]], box(3.5, -1.5, 6.5, 1.5), 0.15) == walled_in


def test_a_way_point_on_a_wall_is_no_mistake_where_a_place_beside_it_is_free() -> None:
    assert parted([ROUTE[0], (5.0, 0.0), ROUTE[1]], [(5.0, -1.0, 5.0, 1.0)], 0.15) is None
