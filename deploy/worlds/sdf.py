"""Reader and writer of SDFormat worlds: boxes, cylinders, spheres and polylines, as a robot on the floor meets them.

http://sdformat.org/spec. Poses are x y z roll pitch yaw, of a model, its link and its collision, each in the one
before.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from math import atan2, cos, hypot, sin
from pathlib import Path
from xml.sax.saxutils import quoteattr

from lfa.deploy.worlds.drawing import WorldDrawing, number, numbers, text_of
from lfa.deploy.worlds.xml_tree import Element, parsed
from lfa.protocol.errors import Refused
from lfa.world.description.scenario import Obstacle, Point, Scenario

LOW_M, HIGH_M = 0.02, 0.5
"""Heights [m] between which a robot meets a body: what lies lower is driven over, what hangs higher driven under."""
WALL_M = 0.05
"""Thickness [m] up to which a box is a wall."""
HEIGHT_M = 1.0
"""Height [m] of what is written."""
TILT_MAX = 1e-3
INCLUDES_MAX, INCLUDES_DEEP_MAX = 500, 5
"""Largest number of included models, and of models that include one another."""
ABOVE_MAX = 5
"""Number of folders above a file in which, and beside which, its models are looked for."""
DRAWN_WALL_M = 0.01

Frame = tuple[float, float, float, float]
"""x [m], y [m], z [m], yaw [rad] of what stands upright."""


def read_sdf(root: Element, drawing: WorldDrawing, file: Path | None = None) -> None:
    """Add all that stands in the way in the first world, or in the models, of an SDF file. Raises Refused.

    Models that it includes are read from the folders of `model_folders(file)`; without `file` they are left out.
    """
    if root.name != "sdf":
        raise Refused(f"<{root.name[:40]}>: must be <sdf>")
    world = root.find("world")
    _SdfReader(drawing, model_folders(file)).read(root if world is None else world, (), INCLUDES_DEEP_MAX)


def model_folders(file: Path | None) -> tuple[Path, ...]:
    """Return where models are looked for: above the file, `models` beside those folders, and Gazebo's variables."""
    if file is None:
        return ()
    above = file.resolve().parents[:ABOVE_MAX]
    named = [
        path for name in ("GZ_SIM_RESOURCE_PATH", "GAZEBO_MODEL_PATH") for path in os.environ.get(name, "").split(":")
    ]
    return (*above, *(folder / "models" for folder in above), *(Path(path) for path in named if path))


class _SdfReader:
    """Reader of one file and of the models that it includes."""

    def __init__(self, drawing: WorldDrawing, folders: tuple[Path, ...]) -> None:
        self._drawing = drawing
        self._folders = folders
        self._includes = 0

    def read(self, parent: Element, outer: tuple[Element, ...], deep: int) -> None:
        """Add the models in `parent`, and those that it includes; `outer` hold the poses around it."""
        for model in parent.all("model"):
            self._read_model(model, (*outer, model), deep)
        for include in parent.all("include"):
            self._include(include, outer, deep)

    def _read_model(self, model: Element, frames: tuple[Element, ...], deep: int) -> None:
        name = model.attributes.get("name", "")[:40]
        for link in model.all("link"):
            for collision in link.all("collision"):
                where = f"model {name!r}, collision {collision.attributes.get('name', '')[:40]!r}"
                try:
                    frame = _upright((*frames, link, collision))
                    if frame is None:
                        self._drawing.skipped.append(f"{where}: tilted, or relative to another frame")
                    else:
                        _read_geometry(collision, frame, self._drawing, where)
                except Refused as refused:
                    raise Refused(f"{where}: {refused}") from None
        self.read(model, frames, deep)

    def _include(self, include: Element, outer: tuple[Element, ...], deep: int) -> None:
        """Add an included model, at the pose of the include if it has one, else at its own."""
        uri = include.find("uri")
        name = "" if uri is None else uri.text.strip()
        self._includes += 1
        path = self._path(name) if self._includes <= INCLUDES_MAX and deep else None
        if path is None:
            self._drawing.skipped.append(f"include {name[:60]}")
            return
        try:
            root = parsed(text_of(path))
            for model in root.all("model"):
                placed = model if include.find("pose") is None else include
                self._read_model(model, (*outer, placed), deep - 1)
        except Refused as refused:
            raise Refused(f"include {name[:60]}: {refused}") from None

    def _path(self, uri: str) -> Path | None:
        """Return the file of a model `model://NAME`, None if it is in none of the folders."""
        scheme, _, name = uri.partition("://")
        parts = [part for part in name.split("/") if part]
        if scheme != "model" or not parts or ".." in parts:
            return None
        files = (folder.joinpath(*parts, "model.sdf") for folder in self._folders)
        return next((file for file in files if file.is_file()), None)


def _upright(chain: tuple[Element, ...]) -> Frame | None:
    """Return the frame of the innermost of `chain`; None if it is tilted or relative to a named frame."""
    x = y = z = yaw = 0.0
    for element in chain:
        pose = element.find("pose")
        if pose is None:
            continue
        values = numbers(pose.text, "pose")
        if len(values) not in (0, 6):
            raise Refused(f"pose {pose.text.strip()[:40]!r}: must be x y z roll pitch yaw")
        dx, dy, dz, roll, pitch, turn = values or [0.0] * 6
        if max(abs(roll), abs(pitch)) > TILT_MAX or pose.attributes.get("relative_to"):
            return None
        c, s = cos(yaw), sin(yaw)
        x, y, z, yaw = x + c * dx - s * dy, y + s * dx + c * dy, z + dz, yaw + turn
    return x, y, z, yaw


def _read_geometry(collision: Element, frame: Frame, drawing: WorldDrawing, where: str) -> None:
    """Add the shape of a collision, if a robot on the floor meets it."""
    geometry = collision.find("geometry")
    shape = None if geometry is None or not geometry.children else geometry.children[0]
    if shape is None:
        raise Refused("geometry is missing: must be box, cylinder, sphere or polyline")
    x, y, z, yaw = frame
    match shape.name:
        case "box":
            wide, deep, high = _sizes(shape)
            if _is_met(z - 0.5 * high, z + 0.5 * high):
                _add_box(drawing, (x, y, yaw), (wide, deep))
        case "cylinder":
            half = 0.5 * _value(shape, "length")
            if _is_met(z - half, z + half):
                drawing.add_circle(x, y, _value(shape, "radius"))
        case "sphere":
            radius = _value(shape, "radius")
            if _is_met(z - radius, z + radius):
                drawing.add_circle(x, y, radius)
        case "polyline":
            if _is_met(z, z + _value(shape, "height")):
                drawing.add_polygon([_moved(point, frame) for point in _points(shape)])
        case "plane" | "empty":
            pass
        case other:
            drawing.skipped.append(f"{where}: {other[:40]}")


def _add_box(drawing: WorldDrawing, pose: tuple[float, float, float], size: tuple[float, float]) -> None:
    """Add a box; a thin one is a wall along its middle."""
    if min(size) > WALL_M or max(size) <= WALL_M:
        drawing.add_box(*pose, size)
        return
    x, y, yaw = pose
    along = yaw if size[0] >= size[1] else yaw + atan2(1.0, 0.0)
    dx, dy = 0.5 * max(size) * cos(along), 0.5 * max(size) * sin(along)
    drawing.add_line([(x - dx, y - dy), (x + dx, y + dy)])


def _is_met(bottom: float, top: float) -> bool:
    return top > LOW_M and bottom < HIGH_M


def _sizes(box: Element) -> list[float]:
    size = box.find("size")
    values = [] if size is None else numbers(size.text, "size")
    if len(values) != 3 or min(values) <= 0.0:
        raise Refused("size of the box: must be three numbers [m] above 0")
    return values


def _value(shape: Element, name: str) -> float:
    element = shape.find(name)
    value = 0.0 if element is None else number(element.text.strip(), name)
    if value <= 0.0:
        raise Refused(f"{name} of the {shape.name}: must be a number [m] above 0")
    return value


def _points(polyline: Element) -> list[Point]:
    points = [tuple(numbers(point.text, "point")) for point in polyline.all("point")]
    if len(points) < 3 or any(len(point) != 2 for point in points):
        raise Refused("polyline: must be at least three points x y")
    return [(x, y) for x, y in points]


def _moved(point: Point, frame: Frame) -> Point:
    x, y, _, yaw = frame
    return x + cos(yaw) * point[0] - sin(yaw) * point[1], y + sin(yaw) * point[0] + cos(yaw) * point[1]


# --- writing --------------------------------------------------------------------------------------------------------


def sdf_of(scenario: Scenario) -> str:
    """Return walls and obstacles of a drawn scenario as an SDF world; what moves stands where it begins."""
    models = [*_models(scenario)]
    name = quoteattr(scenario.name or "lfa")
    lines = ['<?xml version="1.0"?>', '<sdf version="1.9">', f"  <world name={name}>", *models, "  </world>", "</sdf>"]
    return "\n".join(lines) + "\n"


def _models(scenario: Scenario) -> Iterator[str]:
    for n, (x1, y1, x2, y2) in enumerate(scenario.world.walls_m):
        long, yaw = hypot(x2 - x1, y2 - y1), atan2(y2 - y1, x2 - x1)
        box = f"<box><size>{long:.6f} {DRAWN_WALL_M:g} {HEIGHT_M:g}</size></box>"
        yield _model(f"wall_{n}", (0.5 * (x1 + x2), 0.5 * (y1 + y2), 0.5 * HEIGHT_M, yaw), box)
    for n, obstacle in enumerate(scenario.world.obstacles):
        z, shape = _geometry(obstacle)
        yield _model(f"obstacle_{n}", (*obstacle.center_m, z, 0.0), shape)


def _geometry(obstacle: Obstacle) -> tuple[float, str]:
    """Return the height [m] of an obstacle's origin, and its shape."""
    if obstacle.radius_m is not None:
        size = f"<radius>{obstacle.radius_m:.6f}</radius><length>{HEIGHT_M:g}</length>"
        return 0.5 * HEIGHT_M, f"<cylinder>{size}</cylinder>"
    points = "".join(f"<point>{x:.6f} {y:.6f}</point>" for x, y in obstacle.corners_m or ())
    return 0.0, f"<polyline>{points}<height>{HEIGHT_M:g}</height></polyline>"


def _model(name: str, frame: Frame, shape: str) -> str:
    x, y, z, yaw = frame
    geometry = f"<geometry>{shape}</geometry>"
    return (
        f'    <model name="{name}"><static>true</static><pose>{x:.6f} {y:.6f} {z:g} 0 0 {yaw:.9f}</pose>'
        f'<link name="link"><collision name="collision">{geometry}</collision>'
        f'<visual name="visual">{geometry}</visual></link></model>'
    )
