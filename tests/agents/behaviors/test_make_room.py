"""A follower makes room for a predecessor that comes back, where it cannot pass, and for no other."""

from __future__ import annotations

from math import cos, pi, sin

import pytest

from lfa.agents.behaviors.make_room import (
    BESIDE_M,
    CLEAR_M,
    COMES_S,
    GONE_S,
    HOLD_S,
    NEAR_M,
    PASSES_M,
    ROOM_S,
    MakeRoom,
)
from lfa.agents.following.predecessor import Sighting
from lfa.agents.formation.pose_history import PoseHistory
from lfa.protocol.geometry import STILL, Pose2D, Twist

RADIUS_M = 0.25
AT = Pose2D(2.0, 0.0, 0.0)
COMES = Twist(0.2, 0.0)


def walls(left_m: float, right_m: float) -> list[tuple[float, float]]:
    """Points of two walls beside the robot, in `base_link`."""
    return [(0.1 * n, y) for n in range(-20, 21) for y in (left_m, -right_m)]


def seen(x: float = 2.9, heading: float = pi, twist: Twist = COMES, y: float = 0.0) -> Sighting:
    """The predecessor at (`x`, `y`) in `map`."""
    return Sighting(1, 0, Pose2D(x, y, heading), twist, 0.0, 0.0, 0.0, PoseHistory(1.0))


class Place:
    """A follower that came 2 m straight on, between walls, to where it stands."""

    def __init__(self, points: list[tuple[float, float]], came_m: float = 2.0) -> None:
        self.points, self.room = points, MakeRoom(RADIUS_M)
        for n in range(round(came_m / 0.1) + 1):
            assert self.room.step(seen(9.0, 0.0), points, Pose2D(2.0 - came_m + 0.1 * n, 0.0, 0.0), 0.0) is None

    def does(self, sighting: Sighting, since: float = 1.0) -> Twist | None:
        """What it does about `sighting` after it has seen it for a while."""
        assert self.room.step(sighting, self.points, AT, since) is None, "at the first sight"
        return self.room.step(sighting, self.points, AT, since + COMES_S)


def test_in_a_corridor_it_backs_along_its_trail() -> None:
    twist = Place(walls(0.5, 0.5)).does(seen())
    assert twist is not None
    assert twist.linear_x < 0.0
    assert abs(twist.angular_z) < 1e-9


def test_where_its_trail_ends_it_backs_straight() -> None:
    twist = Place(walls(0.5, 0.5), came_m=0.2).does(seen())
    assert twist is not None
    assert twist.linear_x < 0.0


def test_the_next_one_makes_room_for_a_predecessor_that_reverses() -> None:
    twist = Place(walls(0.5, 0.5)).does(seen(heading=0.0, twist=Twist(-0.2, 0.0)))
    assert twist is not None
    assert twist.linear_x < 0.0


def test_one_that_touches_it_needs_room_although_it_faces_aside() -> None:
    twist = Place(walls(0.5, 0.5)).does(seen(x=2.55, heading=pi - 1.4, twist=STILL))
    assert twist is not None
    assert twist.linear_x < 0.0


PASS_M = 3.0 * RADIUS_M + PASSES_M
"""Room [m] beside the middle of this robot in which a body passes."""
FURTHER_ON = [(x, y) for x, y in walls(0.5, 0.5) if abs(x) > BESIDE_M]


@pytest.mark.parametrize(
    "points",
    [
        pytest.param(walls(0.5, PASS_M + 0.02), id="at its right"),
        pytest.param(walls(PASS_M + 0.02, 0.5), id="at its left"),
        pytest.param([point for point in walls(0.5, 0.5) if point[1] < 0.0], id="where there is no other wall"),
        pytest.param(FURTHER_ON, id="before and behind the narrow place"),
    ],
)
def test_where_a_body_passes_beside_it_nobody_goes_back(points: list[tuple[float, float]]) -> None:
    assert Place(points).does(seen()) is None


@pytest.mark.parametrize(
    "points",
    [
        pytest.param(walls(PASS_M - 0.02, PASS_M - 0.02), id="a little too narrow"),
        pytest.param([*walls(0.5, 0.5), *walls(2.0, 2.0)], id="with room behind its walls"),
    ],
)
def test_where_no_body_passes_it_goes_back(points: list[tuple[float, float]]) -> None:
    twist = Place(points).does(seen())
    assert twist is not None
    assert twist.linear_x < 0.0


def test_the_predecessors_own_body_is_no_wall() -> None:
    right = [point for point in walls(0.5, 0.5) if point[1] < 0.0]
    assert Place([*right, (0.4, 0.42)]).does(seen(x=2.5, y=0.2)) is None


def test_it_backs_along_the_bend_on_which_it_came() -> None:
    points, room = walls(0.5, 0.5), MakeRoom(RADIUS_M)
    for back in (0.1 * n for n in range(15, -1, -1)):
        at = Pose2D(AT.x - 1.5 * sin(back / 1.5), 1.5 * (1.0 - cos(back / 1.5)), -back / 1.5)
        assert room.step(seen(9.0, 0.0), points, at, 0.0) is None
    assert room.step(seen(), points, AT, 1.0) is None
    twist = room.step(seen(), points, AT, 1.0 + COMES_S)
    assert twist is not None
    assert twist.angular_z < -0.05


def test_a_predecessor_that_comes_at_the_first_sight_has_to_come_for_a_while_too() -> None:
    assert MakeRoom(RADIUS_M).step(seen(), walls(0.5, 0.5), AT, 0.0) is None


@pytest.mark.parametrize(
    "sighting",
    [
        pytest.param(seen(heading=0.0), id="it leads on"),
        pytest.param(seen(heading=pi / 2), id="it turns off"),
        pytest.param(seen(twist=Twist(-0.2, 0.0)), id="it reverses away"),
        pytest.param(seen(x=1.1, heading=0.0), id="it comes from behind"),
        pytest.param(seen(x=2.55, heading=0.0, twist=STILL), id="it touches, and faces away"),
        pytest.param(seen(x=2.0 + 2.0 * RADIUS_M + NEAR_M + 0.01), id="it is far away"),
    ],
)
def test_others_need_no_room(sighting: Sighting) -> None:
    assert Place(walls(0.5, 0.5)).does(sighting) is None


def test_it_stands_where_something_is_behind_it_and_once_there_is_room() -> None:
    place = Place([*walls(0.5, 0.5), (-0.28, 0.0)])
    assert place.does(seen()) == STILL
    place = Place(walls(0.5, 0.5))
    assert place.does(seen()) != STILL
    near_m = 2.0 * RADIUS_M + NEAR_M + CLEAR_M
    assert place.room.step(seen(x=2.0 + near_m - 0.01), place.points, AT, 2.0) != STILL
    assert place.room.step(seen(x=2.0 + near_m + 0.01), place.points, AT, 2.0) == STILL


def test_once_the_predecessor_has_turned_away_for_a_while_it_follows_again() -> None:
    place = Place(walls(0.5, 0.5))
    assert place.does(seen()) is not None
    away = seen(heading=0.0)
    assert place.room.step(away, place.points, AT, 1.7) is not None, "a turn that goes on"
    assert place.room.step(away, place.points, AT, 1.0 + COMES_S + GONE_S) is None


def test_while_the_predecessor_looks_for_its_way_it_holds_the_room() -> None:
    place = Place(walls(0.5, 0.5), came_m=0.2)
    assert place.does(seen()) is not None
    aside = seen(heading=pi - 1.2, twist=STILL)
    assert place.room.step(aside, place.points, AT, 0.9 + COMES_S + HOLD_S) is not None
    assert place.room.step(aside, place.points, AT, 1.1 + COMES_S + HOLD_S) is None


def test_it_makes_room_for_a_bounded_time() -> None:
    place = Place(walls(0.5, 0.5))
    assert place.does(seen()) is not None
    assert place.room.step(seen(), place.points, AT, 0.9 + ROOM_S) is not None
    assert place.room.step(seen(), place.points, AT, 1.1 + ROOM_S) is None


def test_where_both_stand_nobody_comes_and_the_follower_follows_again() -> None:
    """A predecessor at rest in its slot may face its follower for ever."""
    place, rests = Place(walls(0.5, 0.5)), seen(x=4.2, twist=STILL)
    assert place.does(seen()) is not None
    stands_s = [0.5 * n for n in range(60) if place.room.step(rests, place.points, AT, 2.0 + 0.5 * n) == STILL]
    assert stands_s[-1] == HOLD_S - 0.5
    assert place.room.step(rests, place.points, AT, 60.0) is None


def test_it_makes_room_for_a_new_predecessor_that_stands_before_it_although_the_last_one_stood_for_long() -> None:
    place, rests = Place(walls(0.5, 0.5)), seen(twist=STILL)
    for now in (1.0, 2.0 * HOLD_S):
        place.room.step(rests, place.points, AT, now)
    assert place.does(rests, 2.0 * HOLD_S + 1.0) is None
    place.room.end()
    assert place.does(rests, 2.0 * HOLD_S + 3.0) is not None
