"""Static entities of the scene: walls, obstacles, terrain, map tiles. Pure functions; shapes in `map`, on the floor."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import cos, pi, sin, sqrt
from typing import Any

import numpy as np
import rerun as rr

from lfa.world.description.scenario import Obstacle, WorldSpec
from lfa.world.description.terrain import Patch, patches_of

INK = (60, 60, 60)
HOLE, RISE = (86, 130, 180), (190, 140, 60)
HATCH_M = 0.12
UNSEEN, FREE, OCCUPIED = (255, 255, 255), (218, 236, 224), (96, 125, 104)
UNDER_ALL_M = -0.05

Point = tuple[float, float]


def standing(world: WorldSpec) -> Iterator[tuple[str, Any]]:
    """Yield entity path and drawing of each static entity; a moving obstacle is drawn around (0, 0)."""
    walls = [flat([(x1, y1), (x2, y2)]) for x1, y1, x2, y2 in world.walls_m]
    if walls:
        yield "world/walls", rr.LineStrips3D(walls, colors=INK, radii=0.05)
    for index, patch in enumerate(patches_of(world)):
        colour = RISE if patch.height_m > 0.0 else HOLE
        yield (
            f"world/terrain/{index}",
            rr.LineStrips3D([flat(line) for line in hatched(patch)], colors=colour, radii=0.02),
        )
    for index, obstacle in enumerate(world.obstacles):
        outline = obstacle.corners_m or circle(obstacle.radius_m or 0.1)
        place = (0.0, 0.0) if moves(obstacle) else obstacle.center_m
        strip = flat([(place[0] + dx, place[1] + dy) for dx, dy in (*outline, outline[0])])
        yield f"world/obstacles/{index}", rr.LineStrips3D([strip], colors=INK, radii=0.04)


def moves(obstacle: Obstacle) -> bool:
    return obstacle.moves or obstacle.mass_kg is not None


def tile(columns: int, cells: bytes) -> rr.Mesh3D:
    """Return a map tile as a textured rectangle in cells; `placed` gives its transform."""
    rows = np.minimum(np.frombuffer(cells, dtype=np.uint8).reshape(-1, columns), 2)
    high = rows.shape[0]
    return rr.Mesh3D(
        vertex_positions=[(0, 0, 0), (columns, 0, 0), (columns, high, 0), (0, high, 0)],
        triangle_indices=[(0, 1, 2), (0, 2, 3)],
        vertex_texcoords=[(0, 1), (1, 1), (1, 0), (0, 0)],
        albedo_texture=np.array((UNSEEN, FREE, OCCUPIED), dtype=np.uint8)[rows[::-1]],
    )


def placed(corner_map: Point, cell_m: float) -> rr.Transform3D:
    """Return the transform from cells to metres, below everything else."""
    return rr.Transform3D(translation=[float(corner_map[0]), float(corner_map[1]), UNDER_ALL_M], scale=cell_m)


def flat(points: Sequence[Point], z: float = 0.0) -> list[tuple[float, float, float]]:
    """Return points of the floor at height `z` [m]: what is drawn higher covers what is lower."""
    return [(x, y, z) for x, y in points]


def circle(radius_m: float, corners: int = 20) -> tuple[Point, ...]:
    angles = (2.0 * pi * n / corners for n in range(corners))
    return tuple((radius_m * cos(angle), radius_m * sin(angle)) for angle in angles)


def hatched(patch: Patch) -> Iterator[list[Point]]:
    """Yield the outline of a terrain patch, and hatch lines across it along its own x axis."""
    a, b = patch.half_x_m or patch.radius_m, patch.half_y_m or patch.radius_m
    corners = circle(patch.radius_m) if patch.radius_m > 0.0 else ((a, -b), (a, b), (-a, b), (-a, -b))
    yield [_laid(patch, u, v) for u, v in (*corners, corners[0])]
    lines = max(1, round(2.0 * b / HATCH_M))
    for n in range(1, lines):
        v = -b + 2.0 * b * n / lines
        reach = sqrt(patch.radius_m**2 - v * v) if patch.radius_m > 0.0 else a
        yield [_laid(patch, -reach, v), _laid(patch, reach, v)]


def _laid(patch: Patch, u: float, v: float) -> Point:
    return patch.x + patch.c * u - patch.s * v, patch.y + patch.s * u + patch.c * v
