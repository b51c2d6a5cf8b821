"""A route past known obstacles: clear of them where there is room, no longer than it must be, gentle."""

from __future__ import annotations

from itertools import pairwise
from math import atan2, hypot

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lfa.agents.leading.known_obstacles import ROOM_M, past_known
from lfa.agents.leading.path_follower import PathFollower
from lfa.agents.leading.route import Route
from lfa.protocol.errors import Refused
from lfa.protocol.geometry import Pose2D, wrap
from lfa.protocol.mission import Leading, Limits, Mission
from lfa.protocol.mission_checks import check_mission

RADIUS_M = 0.15
STRAIGHT = [(0.0, 0.0), (20.0, 0.0)]
circles = st.lists(st.tuples(st.floats(3.0, 17.0), st.floats(-1.5, 1.5), st.floats(0.1, 0.4)), max_size=4)


def clearance_m(points: list[tuple[float, float]], circle: tuple[float, float, float]) -> float:
    x, y, radius = circle
    return min(hypot(x - px, y - py) for px, py in Route(points).points) - radius - RADIUS_M


def test_a_route_past_nothing_is_the_route() -> None:
    assert past_known(STRAIGHT, [(10.0, 1.5, 0.3)], RADIUS_M) == STRAIGHT


def test_an_obstacle_on_the_way_is_passed_with_room_on_the_shorter_side() -> None:
    circle = (10.0, -0.1, 0.25)
    points = past_known(STRAIGHT, [circle], RADIUS_M)
    assert clearance_m(points, circle) >= ROOM_M - 0.1
    assert max(y for _, y in points) == pytest.approx(0.7, abs=0.11)
    assert min(y for _, y in points) == 0.0
    assert Route(points).length_m < 20.2


@settings(max_examples=40)
@given(known=circles)
def test_a_route_begins_and_ends_where_it_should_bends_gently_and_stays_near(
    known: list[tuple[float, float, float]],
) -> None:
    points = past_known(STRAIGHT, known, RADIUS_M)
    assert (points[0], points[-1]) == (STRAIGHT[0], STRAIGHT[-1])
    headings = [atan2(b[1] - a[1], b[0] - a[0]) for a, b in pairwise(points)]
    assert max((abs(wrap(b - a)) for a, b in pairwise(headings)), default=0.0) < 0.45
    assert max(abs(y) for _, y in points) <= 2.0


def test_a_leader_with_known_obstacles_drives_past_them() -> None:
    leading = Leading(route_m=((20.0, 0.0),), known_m=((10.0, 0.0, 0.25),))
    lead = PathFollower(leading, Limits(), RADIUS_M)
    lead.begin(Pose2D())
    assert lead.route is not None
    assert min(hypot(x - 10.0, y) for x, y in lead.route.points) > 0.25 + RADIUS_M + 0.2


@pytest.mark.parametrize(
    ("known", "motion", "line"),
    [
        (((1.0, 2.0, -0.1),), "path_following", "mission.leading.known_m[0] = [1.0, 2.0, -0.1]: must be x, y, radius"),
        (((1.0, float("nan"), 0.1),), "path_following", "must be x, y, radius"),
        (((1.0, 2.0, 0.1),), "explore", "left out without motion"),
        (((1.0, 2.0, 0.1),) * 65, "path_following", "65 circles: must be at most 64"),
    ],
)
def test_known_obstacles_that_are_none_are_refused(known: object, motion: str, line: str) -> None:
    leading = Leading(motion=motion, route_m=((20.0, 0.0),), known_m=known)  # type: ignore[arg-type]
    with pytest.raises(Refused) as refused:
        check_mission(Mission(leading=leading))
    assert line in str(refused.value)
