"""What moves at the end of a wall is told; walls that a robot drives past, with few beams as well, do not move."""

from __future__ import annotations

from itertools import pairwise
from math import cos, hypot, inf, pi, sin

import pytest

from lfa.agents.perception.obstacle_tracker import Tracker
from lfa.agents.perception.scan import SIGHT_M, Point

Segment = tuple[float, float, float, float]

MOUTH: tuple[Segment, ...] = ((3.0, 0.34, 6.0, 0.34), (3.0, -0.34, 6.0, -0.34), (3.0, 0.34, 3.0, 5.0),
                              (3.0, -0.34, 3.0, -5.0))  # fmt: skip
"""A corridor that opens out of a wall."""


def range_of(segment: Segment, eye: Point, angle: float) -> float:
    """Return the range [m] at which a beam meets a wall; inf where it does not."""
    (ax, ay, bx, by), (x, y) = segment, eye
    c, s = cos(angle), sin(angle)
    across = c * (by - ay) - s * (bx - ax)
    if abs(across) < 1e-9:
        return inf
    along = ((ax - x) * (by - ay) - (ay - y) * (bx - ax)) / across
    share = ((ax - x) * s - (ay - y) * c) / across
    return along if along > 0.0 and 0.0 <= share <= 1.0 else inf


def scan(walls: tuple[Segment, ...], eye: Point, beams: int) -> list[Point]:
    points = []
    for n in range(beams):
        angle = -pi + n * 2.0 * pi / beams
        r = min(range_of(wall, eye, angle) for wall in walls)
        if r < SIGHT_M:
            points.append((eye[0] + r * cos(angle), eye[1] + r * sin(angle)))
    return points


def look(tracker: Tracker, walls: tuple[Segment, ...], eye: Point, n: int, beams: int = 180) -> None:
    """The `n`-th of ten scans a second."""
    tracker.update(scan(walls, eye, beams), eye, [], 0.5, 0.1 * n, step_rad=2.0 * pi / beams)


@pytest.mark.parametrize("mps", [0.3, 0.42, 0.8])
def test_a_door_that_slides_out_of_a_wall_is_told_before_it_has_come_forty_centimetres(mps: float) -> None:
    tracker, n = Tracker(), 0
    while tracker.moving(0.1 * n) == []:
        n += 1
        end_y = -0.6 + mps * 0.1 * max(0, n - 10)
        look(tracker, ((1.2, -4.0, 1.2, -0.6), (1.1, -4.0, 1.1, end_y)), (0.4, 0.0), n)
        assert end_y < -0.2
    [edge] = tracker.moving(0.1 * n)
    assert abs(edge.x - 1.1) < 0.15
    assert edge.vy > 0.4 * mps


def test_a_thick_door_is_told_all_the_way_although_it_comes_off_its_wall_in_the_scan() -> None:
    """Seen from the doorway, its long face is so sparse that the rest is a thing of its own, and then an edge."""
    tracker, told = Tracker(), []
    for n in range(19):
        end_y = -1.0 + 0.042 * n
        sides = ((4.9, end_y - 1.5, 4.9, end_y), (4.9, end_y, 5.1, end_y), (5.1, end_y, 5.1, end_y - 1.5))
        look(tracker, ((5.0, 0.6, 5.0, 4.0), (5.0, -0.6, 5.0, -4.0), *sides), (4.28 + 0.04 * n, 0.0), n)
        told.append(tracker.moving(0.1 * n) != [])
    assert all(told[12:]), told


@pytest.mark.parametrize("beams", [60, 90, 180])
@pytest.mark.parametrize("step_m", [0.04, -0.03])
def test_a_wall_with_a_mouth_that_a_robot_drives_to_or_from_does_not_move(beams: int, step_m: float) -> None:
    tracker = Tracker()
    for n in range(60):
        eye = (1.5 if step_m > 0.0 else 4.0) + step_m * n, 0.05 * sin(n / 5.0)
        look(tracker, MOUTH, eye, n, beams)
        assert tracker.moving(0.1 * n) == [], f"seen from {eye}"


@pytest.mark.parametrize("beams", [60, 180])
def test_the_end_of_a_wall_that_a_robot_drives_past_does_not_move(beams: int) -> None:
    tracker = Tracker()
    for n in range(60):
        look(tracker, ((2.0, -0.5, 2.0, -4.0), (2.0, 0.7, 5.0, 0.7)), (0.06 * n, 0.0), n, beams)
        assert tracker.moving(0.1 * n) == [], f"from {0.06 * n:.2f} m"


def test_a_team_mate_that_drives_on_beside_a_wall_is_no_door() -> None:
    tracker = Tracker()
    for n in range(30):
        y = -0.7 + 0.03 * n
        body = (1.1, y - 0.1, 1.1, y + 0.1)
        points = scan(((1.2, -4.0, 1.2, -0.6), body), (0.4, 0.0), 180)
        tracker.update(points, (0.4, 0.0), [(1.2, y)], 0.5, 0.1 * n, step_rad=pi / 90)
        assert tracker.moving(0.1 * n) == []


def test_a_wall_that_comes_into_sight_far_from_all_that_was_seen_does_not_move() -> None:
    """Beams that met nothing there meet a wall now, as behind a curtain that is drawn aside."""
    tracker = Tracker()
    for n in range(60):
        walls: tuple[Segment, ...] = ((-3.0, -1.0, 5.0, -1.0),)
        look(tracker, walls if n < 30 else (*walls, (1.5, 0.0, 1.5, 3.0)), (0.4, 0.0), n)
        assert tracker.moving(0.1 * n) == []


@pytest.mark.parametrize("mps", [0.3, 0.6])
def test_a_thing_that_leaves_a_wall_is_told_before_it_has_come_half_a_metre(mps: float) -> None:
    tracker, n = Tracker(), 0
    while not (moving := tracker.moving(0.1 * n)):
        n += 1
        y = -0.7 + mps * 0.1 * max(0, n - 10)
        sides = [(1.4 + 0.25 * cos(k * pi / 8), y + 0.25 * sin(k * pi / 8)) for k in range(17)]
        look(tracker, ((-3.0, -1.0, 5.0, -1.0), *((*a, *b) for a, b in pairwise(sides))), (0.4, 0.0), n)
        assert y < -0.2
    [thing] = moving
    assert hypot(thing.x - 1.4, thing.y - y) < 0.3
    assert thing.vy > 0.4 * mps


ROOM: tuple[Segment, ...] = ((2.0, -2.0, 2.0, 2.0), (-2.0, 2.0, 2.0, 2.0), (-2.0, -2.0, -2.0, 2.0),
                             (0.5, -1.0, 2.0, -1.0))  # fmt: skip


def most_moving(forgets: bool) -> int:
    """The most that seems to move in a room at rest, as the robot's pose is corrected by 0.14 m after a second."""
    tracker, most = Tracker(), 0
    for n in range(30):
        off = 0.1 if n >= 10 else 0.0
        points = [(x + off, y - off) for x, y in scan(ROOM, (0.0, 0.0), 180)]
        if n == 10 and forgets:
            tracker.forget_surfaces()
        tracker.update(points, (off, -off), [], 0.5, 0.1 * n, step_rad=pi / 90)
        most = max(most, len(tracker.moving(0.1 * n)))
    return most


def test_the_walls_of_a_room_do_not_move_as_the_pose_of_the_robot_jumps() -> None:
    assert most_moving(forgets=False) > 0
    assert most_moving(forgets=True) == 0
