"""Courses that are hard without a map: gaps hardly wider than the body, traps, corners, a door that closes.

The seed draws the sizes within the limits below, so that more seeds are more courses.
"""

from __future__ import annotations

from collections.abc import Callable
from random import Random

from msgspec import Struct

from lfa.deploy.bench.driving.course_file import Course, Segment

ROOM_M = 0.05
"""Room [m] at each side of the body in a gap."""
CORRIDOR_M = 0.70
FAR_M = 6.0
"""Half of the length [m] of the walls that hold a gap or a door: the way round them is longer than through them."""
DOOR_MPS = 0.42
SWING_M, SWINGS = 0.1, 600
"""A door that has closed moves to and fro by this distance [m] in its frame; this many times outlast each run."""


class CourseKind(Struct, frozen=True):
    """Kind of course: its row's name, and the course that a random generator and the body's radius [m] give."""

    name: str
    draw: Callable[[Random, float], Course]
    motions: tuple[str, ...] = ("path_following", "point_to_point", "explore", "reactive")
    radii_m: tuple[float, ...] = (0.15,)


def gap(chance: Random, radius_m: float) -> Course:
    """Return a wall across the way with a gap of the body and `ROOM_M` on each side, up to 1 m beside the line."""
    half_m, at = radius_m + ROOM_M, chance.uniform(-1.0, 1.0)
    thick_m = chance.choice((0.0, 0.3))
    walls: list[Segment] = []
    for x in {5.0, 5.0 + thick_m}:
        walls += [(x, at + half_m, x, FAR_M), (x, at - half_m, x, -FAR_M)]
    if thick_m:
        walls += [(5.0, at + half_m, 5.0 + thick_m, at + half_m), (5.0, at - half_m, 5.0 + thick_m, at - half_m)]
    return Course(((0.0, 0.0), (12.0, 0.0)), tuple(walls))


def u_trap(chance: Random, _radius_m: float) -> Course:
    """Return a pocket on the line, open towards the team, 2 to 6 m deep and 1.6 to 4 m wide."""
    left, right, deep = chance.uniform(0.8, 2.0), chance.uniform(0.8, 2.0), chance.uniform(2.0, 6.0)
    mouth, end = 3.0, 3.0 + deep
    walls = ((mouth, left, end, left), (end, left, end, -right), (end, -right, mouth, -right))
    return Course(((0.0, 0.0), (end + 5.0, 0.0)), walls, time_limit_s=300.0)


def corner(chance: Random, _radius_m: float) -> Course:
    """Return a corridor of 0.7 m with a corner of 90 degrees to the left or right."""
    side, half = chance.choice((1.0, -1.0)), 0.5 * CORRIDOR_M
    x, end = chance.uniform(4.0, 7.0), chance.uniform(3.0, 5.0)
    walls = (
        (2.0, -half * side, x + half, -half * side), (x + half, -half * side, x + half, end * side),
        (2.0, half * side, x - half, half * side), (x - half, half * side, x - half, end * side),
        (2.0, half * side, 2.0, FAR_M * side), (2.0, -half * side, 2.0, -FAR_M * side),
    )  # fmt: skip
    return Course(((0.0, 0.0), (x, 0.0), (x, (end + 3.0) * side)), walls)


def closing_door(chance: Random, _radius_m: float) -> Course:
    """Return a wall with a door that closes after the leader, or after one of its followers, has passed."""
    start_y = -chance.uniform(5.5, 8.0)
    swing = ", ".join(f"[5.0, {n % 2 * SWING_M:g}]" for n in range(2 * SWINGS))
    corners = "[[-0.1, -0.75], [0.1, -0.75], [0.1, 0.75], [-0.1, 0.75]]"
    door = (
        f"{{ center_m = [5.0, {start_y:.2f}], corners_m = {corners}, speed_mps = {DOOR_MPS}, waypoints_m = [{swing}] }}"
    )
    return Course(((0.0, 0.0), (12.0, 0.0)), ((5.0, 0.6, 5.0, 4.0), (5.0, -0.6, 5.0, -4.0)), (door,))


KINDS = (
    CourseKind("gap", gap, radii_m=(0.15, 0.25)),
    CourseKind("u_trap", u_trap),
    CourseKind("corner", corner),
    CourseKind("closing_door", closing_door),
)
