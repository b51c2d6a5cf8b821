"""A scenario in a world that was read from a file: a way from start to goal, and the team in column on it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import atan2, hypot

import numpy as np

from lfa.deploy.recording.run_folder import toml_value
from lfa.deploy.worlds.drawing import WorldDrawing
from lfa.deploy.worlds.grid import CELLS_MAX, Cell, Taken, center_of, grid_of, is_clear, way_to, ways_from, widened
from lfa.protocol.errors import Refused
from lfa.protocol.mission import FormationSpec, Mission
from lfa.world.description.maps import Map
from lfa.world.description.scenario import Obstacle, Point

CELL_M = 0.1
CLEARANCES_M = (0.35, 0.2, 0.1)
"""Free room [m] beside a robot that is tried along the way, the widest first."""
ROBOTS = 4
RADIUS_M = Mission().radius_m
SEPARATION_M = FormationSpec().separation_m
BORDER_SHARE = 0.1
"""Share of a world that must be walled in for its walls to be a border, which nobody leaves."""
GAP_M = 0.3
"""Free room [m] between two robots of a large radius."""
CRUISE_MPS = 0.5
TIME_LIMIT_S, SLOWNESS = 60.0, 4.0
"""Time limit: a minute, and this many times the time that the way takes at cruise speed."""


def scenario_text(drawing: WorldDrawing, robots: int | None, start: Point | None, goal: Point | None) -> str:
    """Return the scenario as TOML. Raises Refused where no way leads from start to goal."""
    start, goal = start or drawing.start, goal or drawing.goal
    _check_inside(drawing, "start", start)
    _check_inside(drawing, "goal", goal)
    radius_m = drawing.radius_m or RADIUS_M
    separation_m = max(SEPARATION_M, 2.0 * radius_m + GAP_M)
    team = robots or drawing.robots or ROBOTS
    drawn = grid_of(drawing.walls, drawing.obstacles, [p for p in (start, goal) if p is not None], CELL_M, CELLS_MAX)
    way = _way(drawn, _beyond(drawn, drawing), radius_m, (start, goal), team * separation_m)
    starts, route = _laid(way, team, separation_m)
    length_m = _length_m(way)
    lines = [
        f"title = {toml_value(drawing.name)}",
        f"time_limit_s = {TIME_LIMIT_S + round(SLOWNESS * length_m / CRUISE_MPS):g}",
        f"\n[mission]\nrobots = {toml_value(list(range(1, team + 1)))}\nradius_m = {radius_m:g}",
        f'\n[mission.formation]\nside = "column"\nseparation_m = {separation_m:g}',
        f"\n[mission.leading]\nroute_m = {_rows(route)}\ncruise_mps = {CRUISE_MPS:g}",
        f"\n[world]\nstarts = {_rows(starts)}\nwalls_m = {_rows(drawing.walls)}",
        *(_obstacle(obstacle) for obstacle in drawing.obstacles),
    ]
    return "\n".join(lines) + "\n"


def _rows(rows: Sequence[tuple[float, ...]]) -> str:
    if not rows:
        return "[]"
    return "[\n" + "".join(f"  {toml_value([round(value, 6) for value in row])},\n" for row in rows) + "]"


def _obstacle(obstacle: Obstacle) -> str:
    corners = obstacle.corners_m
    shape = f"radius_m = {obstacle.radius_m}" if corners is None else f"corners_m = {toml_value(corners)}"
    return f"\n[[world.obstacles]]\ncenter_m = {toml_value(list(obstacle.center_m))}\n{shape}"


def _check_inside(drawing: WorldDrawing, what: str, point: Point | None) -> None:
    """Raise Refused for a start or goal outside of a map."""
    if point is None or drawing.bounds_m is None:
        return
    x1, y1, x2, y2 = drawing.bounds_m
    if not (x1 <= point[0] <= x2 and y1 <= point[1] <= y2):
        right = f"must be from {x1:g}, {y1:g} to {x2:g}, {y2:g}"
        raise Refused(f"{what} ({point[0]:g}, {point[1]:g}): outside of the map, {right}")


def _beyond(drawn: Map, drawing: WorldDrawing) -> Taken:
    """Return the cells beyond the bounds of a world, where it has any."""
    beyond = np.zeros(drawn.cells.shape, dtype=bool)
    if drawing.bounds_m is not None:
        (low_row, low_column), (high_row, high_column) = (
            (int((y - drawn.origin[1]) / drawn.resolution_m), int((x - drawn.origin[0]) / drawn.resolution_m))
            for x, y in (drawing.bounds_m[:2], drawing.bounds_m[2:])
        )
        beyond[:] = True
        beyond[low_row : high_row + 1, low_column : high_column + 1] = False
    return beyond


def _way(
    drawn: Map, beyond: Taken, radius_m: float, ends: tuple[Point | None, Point | None], long_m: float
) -> list[Point]:
    """Return the corners of a way with as much room beside it as there is, none of them `beyond`, and `long_m` [m] long
    where there is one. Raises Refused.
    """
    refused, short = Refused(""), None
    start, goal = ends
    for clearance_m in CLEARANCES_M:
        taken = widened(drawn, radius_m + clearance_m) | beyond
        try:
            cells = _cells(drawn, taken, start, goal)
        except Refused as error:
            refused = error
            continue
        points = [center_of(drawn, cell) for cell in _straightened(taken, cells)]
        way = [start or points[0], *points[1:]]
        way[-1] = goal or way[-1]
        if _length_m(way) >= long_m:
            return way
        short = short or way
    if short is None:
        raise refused
    return short


def _cells(drawn: Map, taken: Taken, start: Point | None, goal: Point | None) -> list[Cell]:
    """Return the cells of the shortest way; an end that is not given lies as far away as can be. Raises Refused."""
    taken |= _outside(drawn, taken, start)
    first = _free_cell(drawn, taken, start, "start")
    last = None if goal is None else _free_cell(drawn, taken, goal, "goal")
    length, before = ways_from(taken, first if start is not None or last is None else last)
    if start is None:
        first = _farthest(length)
        length, before = ways_from(taken, first)
    last = last or _farthest(length)
    if not np.isfinite(length[last]):
        (x, y), (gx, gy) = center_of(drawn, first), center_of(drawn, last)
        raise Refused(f"no way leads from ({x:.2f}, {y:.2f}) to ({gx:.2f}, {gy:.2f}): give another --start or --goal")
    return way_to(before, last)


def _outside(drawn: Map, taken: Taken, start: Point | None) -> Taken:
    """Return the cells around a world that has a border; none of one without, or where the start lies out there."""
    if taken[1, 1]:
        return np.zeros_like(taken)
    outside = np.isfinite(ways_from(taken, (1, 1))[0])
    cell = None if start is None else drawn.cell_of(*start)
    inside = int((~taken & ~outside).sum())
    has_border = inside > BORDER_SHARE * taken.size if cell is None else not outside[cell]
    return outside & has_border


def _free_cell(drawn: Map, taken: Taken, point: Point | None, what: str) -> Cell:
    """Return the cell of a point, or one in the middle of the largest free row. Raises Refused."""
    if point is None:
        if taken.all():
            raise Refused("no room for a robot is in it: must have free ground")
        rows, columns = np.nonzero(~taken)
        row = int(np.bincount(rows).argmax())
        inside = columns[rows == row]
        return row, int(inside[len(inside) // 2])
    cell = drawn.cell_of(*point)
    if cell is None or taken[cell]:
        raise Refused(f"{what} ({point[0]:g}, {point[1]:g}): no room for a robot there, give another --{what} X,Y")
    return cell


def _farthest(length: np.ndarray) -> Cell:
    row, column = np.unravel_index(int(np.where(np.isfinite(length), length, -1.0).argmax()), length.shape)
    return int(row), int(column)


def _straightened(taken: Taken, cells: list[Cell]) -> list[Cell]:
    """Return the corners that are left when each is as far from the last as a free straight line reaches."""
    corners, at = [cells[0]], 0
    while at < len(cells) - 1:
        low, high = at + 1, len(cells) - 1
        while low < high:
            middle = (low + high + 1) // 2
            low, high = (middle, high) if is_clear(taken, cells[at], cells[middle]) else (low, middle - 1)
        at = low
        corners.append(cells[at])
    return corners


def _laid(way: list[Point], team: int, separation_m: float) -> tuple[list[tuple[float, float, float]], list[Point]]:
    """Return the poses of the team in column, the last robot at the start of `way`, and what is left of it.

    Raises Refused for a way that is too short.
    """
    long = (team - 1) * separation_m
    length_m = _length_m(way)
    if length_m < long + separation_m:
        raise Refused(f"a way of {length_m:.1f} m is too short for {team} robots, {separation_m:g} m apart: --robots 1")
    starts = [_along(way, long - n * separation_m) for n in range(team)]
    gone, route = 0.0, []
    for a, b in pairwise(way):
        gone += hypot(b[0] - a[0], b[1] - a[1])
        if gone > long + 1e-9:
            route.append(b)
    return starts, route


def _length_m(way: list[Point]) -> float:
    return sum(hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(way))


def _along(way: list[Point], at_m: float) -> tuple[float, float, float]:
    """Return the pose on a way `at_m` [m] from its start."""
    for (ax, ay), (bx, by) in pairwise(way):
        long = hypot(bx - ax, by - ay)
        if at_m <= long and long > 0.0:
            return ax + (bx - ax) * at_m / long, ay + (by - ay) * at_m / long, atan2(by - ay, bx - ax)
        at_m -= long
    raise AssertionError("beyond the way's end")
