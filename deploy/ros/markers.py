"""Markers of a formation for RViz and Foxglove: robots by role, slots, lines to predecessors, obstacles. Pure."""

from __future__ import annotations

from typing import Any

import numpy as np
from msgspec import Struct

from lfa.deploy.ros import messages
from lfa.deploy.ros.types import kind
from lfa.protocol.geometry import Pose2D

LIFETIME_S = 1
"""Time [s] after which a viewer removes a marker that is not repeated."""
Colour = tuple[float, float, float, float]
ROLES: dict[str, Colour] = {
    "leader": (0.90, 0.62, 0.0, 1.0),
    "follower": (0.0, 0.45, 0.70, 1.0),
    "waiting": (0.51, 0.51, 0.51, 1.0),
}
SLOT: Colour = (0.6, 0.6, 0.6, 0.6)
LINE: Colour = (0.6, 0.6, 0.6, 1.0)
OBSTACLE: Colour = (0.78, 0.24, 0.16, 0.8)
NAME: Colour = (1.0, 1.0, 1.0, 1.0)
HEIGHT_M = 0.1
_ARROW, _CYLINDER, _LINES, _TEXT = 0, 3, 5, 9


class RobotMark(Struct, frozen=True):
    """What the markers show of one robot; None: not known."""

    robot: int
    role: str
    at: Pose2D
    slot: Pose2D | None = None
    predecessor: int | None = None


class ObstacleMark(Struct, frozen=True):
    """Obstacle that a robot reported: position and radius [m] in `map`."""

    x: float
    y: float
    radius_m: float


def formation(stamp_ns: int, robots: list[RobotMark], obstacles: list[ObstacleMark]) -> Any:
    """Return visualization_msgs/MarkerArray in `map`; ids are robots' ids, so that a marker replaces its last one."""
    places = {one.robot: one.at for one in robots}
    marks = []
    for one in robots:
        colour = ROLES.get(one.role, ROLES["waiting"])
        size = messages.vector(0.4, 0.08, 0.08)
        name = f"{one.robot} {one.role}" if one.role != "follower" else str(one.robot)
        marks.append(_marker(stamp_ns, "robots", one.robot, _ARROW, one.at, size, colour))
        marks.append(_marker(stamp_ns, "names", one.robot, _TEXT, one.at, messages.vector(0, 0, 0.2), NAME, text=name))
        if one.slot is not None:
            flat = messages.vector(0.2, 0.2, 0.02)
            marks.append(_marker(stamp_ns, "slots", one.robot, _CYLINDER, one.slot, flat, SLOT))
        ahead = places.get(one.predecessor) if one.predecessor is not None else None
        if ahead is not None:
            line = [messages.point(one.at.x, one.at.y), messages.point(ahead.x, ahead.y)]
            thin = messages.vector(0.02, 0.0)
            marks.append(_marker(stamp_ns, "predecessors", one.robot, _LINES, Pose2D(), thin, LINE, points=line))
    for n, body in enumerate(obstacles):
        size = messages.vector(2.0 * body.radius_m, 2.0 * body.radius_m, HEIGHT_M)
        marks.append(_marker(stamp_ns, "obstacles", n, _CYLINDER, Pose2D(body.x, body.y), size, OBSTACLE))
    return kind("visualization_msgs/msg/MarkerArray")(markers=marks)


def _marker(
    stamp_ns: int,
    namespace: str,
    number: int,
    shape: int,
    at: Pose2D,
    scale: Any,
    colour: Colour,
    *,
    points: list[Any] | None = None,
    text: str = "",
) -> Any:
    nothing = np.empty(0, dtype=np.uint8)
    place = messages.pose(at)
    place.position.z = 3.0 * HEIGHT_M if text else HEIGHT_M
    return kind("visualization_msgs/msg/Marker")(
        header=messages.header(stamp_ns, "map"),
        ns=namespace,
        id=number,
        type=shape,
        action=0,
        pose=place,
        scale=scale,
        color=kind("std_msgs/msg/ColorRGBA")(*colour),
        lifetime=kind("builtin_interfaces/msg/Duration")(LIFETIME_S, 0),
        frame_locked=False,
        points=points or [],
        colors=[],
        texture_resource="",
        texture=kind("sensor_msgs/msg/CompressedImage")(messages.header(0, ""), "", nothing),
        uv_coordinates=[],
        text=text,
        mesh_resource="",
        mesh_file=kind("visualization_msgs/msg/MeshFile")("", nothing),
        mesh_use_embedded_materials=False,
    )
