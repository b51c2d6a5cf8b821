"""Worlds, teams and scanners that the seed draws: discs, blocks and boards at random, on ground that a body passes.

Unlike the courses, which are hard by design, these vary all at once: body, team, formation, motion, control rate, and
the scanner's beams, range and field of view. What is drawn again until a way with `ROOM_M` beside the body leads to the
goal is good if the whole team arrives there without a contact.
"""

from __future__ import annotations

from math import cos, hypot, inf, pi, sin
from random import Random

import numpy as np
import numpy.typing as npt
from msgspec import Struct

from lfa.deploy.bench.driving.course_file import Course, Point
from lfa.deploy.bench.driving.shortest_way import shortest_m
from lfa.world.description.maps import OCCUPIED, Map

ROOM_M, GOAL_ROOM_M, START_ROOM_M = 0.15, 0.4, 0.2
"""Room [m] beside the body on the way, at the goal, and where the team stands in column at the start."""
HALF_M, BACK_M, BEYOND_M, CELL_M, STEP_M = 5.0, 4.0, 4.0, 0.1, 0.05
"""Half of the ground's width [m], its length [m] behind the start and beyond the goal, the size [m] of the search's
cells, and the distance [m] between points of an outline."""
BOARD_M = 0.06
"""Thickness [m] of a board: what has none cannot be seen from its end."""
CIRCLE = tuple((cos(n * pi / 12), sin(n * pi / 12)) for n in range(24))


class DrawnWorld(Struct, frozen=True):
    """Course of a team, and what else is drawn for it, as arguments of `--set`."""

    course: Course
    motion: str
    robots: int
    sets: tuple[str, ...]


def drawn(seed: int) -> DrawnWorld:
    """Return the first world of `seed` whose goal a body of the team can reach."""
    tries = 0
    while True:
        world = _draw(Random(f"drawn {seed} {tries}"))
        if world is not None:
            return world
        tries += 1


def _draw(chance: Random) -> DrawnWorld | None:
    """Return a world; None if no way leads through it, or something stands on its start or goal."""
    radius_m, length_m = chance.choice((0.12, 0.15, 0.2, 0.25, 0.33)), chance.uniform(8.0, 14.0)
    things = [_thing(chance, length_m) for _ in range(chance.randint(4, 14))]
    outline = np.array([point for points, _ in things for point in points])
    if not passes(outline, radius_m, length_m):
        return None
    return DrawnWorld(
        Course(((0.0, 0.0), (length_m, 0.0)), obstacles=tuple(text for _, text in things)),
        chance.choice(("path_following", "point_to_point", "explore", "reactive")),
        chance.choice((1, 2, 3, 4, 6)),
        (
            f"mission.radius_m={radius_m:g}",
            f"mission.control_hz={chance.choice((50, 50, 20, 12))}",
            f"mission.formation.side={chance.choice(('column', 'left', 'right', 'zigzag'))}",
            f"mission.formation.separation_m={chance.choice((0.8, 1.0, 1.5)) + 2.0 * (radius_m - 0.15):.2f}",
            f"mission.leading.cruise_mps={chance.choice((0.3, 0.5, 0.8))}",
            f"world.lidar.beams={chance.choice((60, 90, 180, 360))}",
            f"world.lidar.range_max_m={chance.choice((3, 5, 8, 12))}",
            f"world.lidar.fov_rad={chance.choice((2.0 * pi, 2.0 * pi, 1.5 * pi, 1.15 * pi))}",
        ),
    )


def _thing(chance: Random, length_m: float) -> tuple[list[Point], str]:
    """Return the outline of a disc, a block or a board on the ground between start and goal, and the thing as TOML."""
    x, y = chance.uniform(1.5, length_m - 1.5), chance.uniform(-3.0, 3.0)
    at, kind = f"center_m = [{x:.3f}, {y:.3f}]", chance.choice(("disc", "block", "board"))
    if kind == "disc":
        radius_m = chance.uniform(0.05, 0.5)
        return [(x + radius_m * c, y + radius_m * s) for c, s in CIRCLE], f"{{ {at}, radius_m = {radius_m:.3f} }}"
    long_m = chance.uniform(0.2, 1.2) if kind == "block" else chance.uniform(0.5, 3.0)
    wide_m = chance.uniform(0.1, 0.5) if kind == "block" else BOARD_M
    angle = chance.uniform(0.0, pi)
    c, s = 0.5 * cos(angle), 0.5 * sin(angle)
    corners = [
        (a * long_m * c - b * wide_m * s, a * long_m * s + b * wide_m * c)
        for a, b in ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
    ]
    outline = [(x + px, y + py) for px, py in _between(corners)]
    return outline, f"{{ {at}, corners_m = [{', '.join(f'[{px:.4f}, {py:.4f}]' for px, py in corners)}] }}"


def _between(corners: list[Point]) -> list[Point]:
    """Return points on the sides of a polygon, at most `STEP_M` apart."""
    points: list[Point] = []
    for (ax, ay), (bx, by) in zip(corners, [*corners[1:], corners[0]], strict=True):
        parts = int(hypot(bx - ax, by - ay) / STEP_M) + 1
        points += [(ax + (bx - ax) * n / parts, ay + (by - ay) * n / parts) for n in range(parts)]
    return points


def passes(outline: npt.NDArray[np.float64], radius_m: float, length_m: float) -> bool:
    """Return whether start and goal are free, and a way leads from one to the other."""
    column = np.array([(-0.1 * n, y) for n in range(int(BACK_M / 0.1)) for y in (-0.5, 0.0, 0.5)])
    for places, room_m in ((column, START_ROOM_M), (np.array([(length_m, 0.0)]), GOAL_ROOM_M)):
        apart = np.hypot(*(places[:, None, :] - outline[None, :, :]).transpose(2, 0, 1))
        if apart.min() < radius_m + room_m:
            return False
    cells = np.zeros((round(2.0 * HALF_M / CELL_M), round((BACK_M + length_m + BEYOND_M) / CELL_M)), dtype=np.int16)
    rows, columns = ((outline[:, 1] + HALF_M) / CELL_M).astype(int), ((outline[:, 0] + BACK_M) / CELL_M).astype(int)
    cells[rows, columns] = OCCUPIED
    ground = Map(cells, CELL_M, (-BACK_M, -HALF_M, 0.0))
    return shortest_m(ground, (0.0, 0.0), (length_m, 0.0), radius_m + ROOM_M) < inf
