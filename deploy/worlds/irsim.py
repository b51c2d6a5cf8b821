"""Reader of IR-SIM worlds (YAML): its border, its obstacles, and the way of its first robot."""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, sin
from typing import Any

import yaml

from lfa.deploy.worlds.drawing import WorldDrawing, number
from lfa.protocol.errors import Refused
from lfa.world.description.scenario import Point

COPIES_MAX = 500
"""Largest `number` of one entry."""
RADIUS_M = 0.2
"""Radius [m] of a body whose shape names none, as in IR-SIM."""
DEPTH_MAX = 50


class _Loader(yaml.SafeLoader):  # type: ignore[misc]  # pyyaml has no types
    """Loader without aliases, which may stand for a text without end."""

    depth = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent) or self.depth > DEPTH_MAX:
            raise yaml.YAMLError("an alias (*name), or more than 50 lists in one another: must be written out")
        self.depth += 1
        try:
            return super().compose_node(parent, index)
        finally:
            self.depth -= 1


def loaded(text: str) -> dict[str, Any]:
    """Return the mapping in a YAML text. Raises Refused with one line."""
    try:
        value = yaml.load(text, _Loader)
    except (yaml.YAMLError, ValueError, OverflowError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        line = "" if mark is None else f"line {mark.line + 1}: "
        said = " ".join(str(getattr(error, "problem", None) or error).split())[:80]
        raise Refused(f"{line}{said}: must be YAML") from None
    if not isinstance(value, dict):
        raise Refused("must be YAML with the keys world, robot and obstacle")
    return value


def read_irsim(document: dict[str, Any], drawing: WorldDrawing) -> None:
    """Add border, obstacles, start and goal of an IR-SIM world. Raises Refused."""
    if "world" not in document:
        raise Refused("world is missing: must be an IR-SIM world, with the keys world, robot and obstacle")
    world = _table(document["world"], "world")
    _add_border(world, drawing)
    if "obstacle_map" in world:
        drawing.skipped.append("world.obstacle_map: import the grid itself, as a ROS map")
    for where, entry in _entries(document, "obstacle"):
        for n, pose in enumerate(_poses(entry, where, drawing)):
            _add_shape(_shape(entry, n), pose, where, drawing)
    robots = [
        (where, entry, pose) for where, entry in _entries(document, "robot") for pose in _poses(entry, where, drawing)
    ]
    if not robots:
        return
    where, entry, pose = robots[0]
    drawing.robots, drawing.start = len(robots), pose[:2]
    goal = entry.get("goal")
    while isinstance(goal, list) and goal and isinstance(goal[0], list):
        goal = goal[0]  # of several robots the first one's, of several goals of one robot the first
    if goal is not None:
        drawing.goal = _point(goal, f"{where}.goal")
    shape = _shape(entry, 0)
    if shape.get("name", "circle") == "circle":
        drawing.radius_m = number(shape.get("radius", RADIUS_M), f"{where}.shape.radius")


def _add_border(world: dict[str, Any], drawing: WorldDrawing) -> None:
    wide, high = (number(world.get(key, 10.0), f"world.{key}") for key in ("width", "height"))
    x, y = _point(world.get("offset", [0.0, 0.0]), "world.offset")
    if min(wide, high) <= 0.0:
        raise Refused(f"world.width, world.height = {wide:g}, {high:g}: must be above 0")
    drawing.add_line([(x, y), (x + wide, y), (x + wide, y + high), (x, y + high), (x, y)])


def _entries(document: dict[str, Any], key: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the entries below `robot` or `obstacle`, each with where it stands; older files say the plural."""
    for name in (key, f"{key}s"):
        entries = document.get(name) or []
        for n, entry in enumerate(entries if isinstance(entries, list) else [entries]):
            yield f"{name}[{n}]", _table(entry, f"{name}[{n}]")


def _poses(entry: dict[str, Any], where: str, drawing: WorldDrawing) -> Iterator[tuple[float, float, float]]:
    """Yield x, y, theta of each copy of an entry whose places are written; those drawn at random are skipped."""
    copies = entry.get("number", 1)
    if not isinstance(copies, int) or not 1 <= copies <= COPIES_MAX:
        raise Refused(f"{where}.number = {str(copies)[:20]}: must be a whole number from 1 to {COPIES_MAX}")
    states = entry.get("state", [0.0, 0.0, 0.0])
    several = isinstance(states, list) and bool(states) and isinstance(states[0], list)
    distribution = entry.get("distribution")
    kind = distribution.get("name") if isinstance(distribution, dict) else None
    if kind not in (None, "manual") or (copies > 1 and not several):
        drawing.skipped.append(f"{where}: {copies} places that IR-SIM draws by itself")
        return
    for state in states[:copies] if several else [states]:
        x, y, *rest = _values(state, f"{where}.state", 2)
        yield x, y, rest[0] if rest else 0.0


def _add_shape(shape: dict[str, Any], pose: tuple[float, float, float], where: str, drawing: WorldDrawing) -> None:
    x, y, theta = pose
    name = shape.get("name", "circle")
    match name:
        case "circle":
            radius_m = number(shape.get("radius", RADIUS_M), f"{where}.shape.radius")
            center = shape.get("center")
            dx, dy = (0.0, 0.0) if center is None else _point(center, f"{where}.shape.center")
            drawing.add_circle(*_moved((dx, dy), pose), radius_m)
        case "rectangle":
            sizes = [number(shape.get(key, 1.0), f"{where}.shape.{key}") for key in ("length", "width")]
            drawing.add_box(x, y, theta, (sizes[0], sizes[1]))
        case "polygon" | "linestring" if isinstance(shape.get("vertices"), list):
            points = [_moved(_point(vertex, f"{where}.shape.vertices"), pose) for vertex in shape["vertices"]]
            if len(points) < 2:
                raise Refused(f"{where}.shape.vertices: must be at least two points")
            if name == "polygon":
                drawing.add_polygon(points)
            else:
                drawing.add_line(points)
        case _:
            drawing.skipped.append(f"{where}: shape {str(name)[:40]} without its corners")


def _shape(entry: dict[str, Any], n: int) -> dict[str, Any]:
    """Return the shape of the `n`-th copy of an entry; of several shapes the last one is that of all further copies."""
    shape = entry.get("shape", {})
    if isinstance(shape, list) and shape:
        shape = shape[min(n, len(shape) - 1)]
    return shape if isinstance(shape, dict) else {"name": shape}


def _moved(point: Point, pose: tuple[float, float, float]) -> Point:
    x, y, theta = pose
    return x + cos(theta) * point[0] - sin(theta) * point[1], y + sin(theta) * point[0] + cos(theta) * point[1]


def _point(value: Any, where: str) -> Point:
    x, y, *_ = _values(value, where, 2)
    return x, y


def _values(value: Any, where: str, least: int) -> list[float]:
    if not isinstance(value, list) or len(value) < least:
        raise Refused(f"{where} = {str(value)[:40]}: must be a list of at least {least} numbers")
    return [number(item, where) for item in value[:3]]


def _table(value: Any, where: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise Refused(f"{where} = {str(value)[:40]}: must be a table of keys")
    return value
