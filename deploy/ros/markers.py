"""Markers of a formation for RViz and Foxglove: robots by role, slots, lines to predecessors, obstacles. Pure."""

from __future__ import annotations

from typing import NamedTuple

from msgspec import Struct

from lfa.deploy.ros.cdr import CdrMessage, CdrWriter
from lfa.deploy.ros.messages import placed, shown_id
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
_UNLOCKED, _NO_MATERIALS = 0, 0
_NO_TEXTURE = CdrWriter().int32(0).string("").time(0).string("", "").int32(0, 0).bytes()
"""No colours, name, image and coordinates of a texture."""


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


def formation(stamp_ns: int, robots: list[RobotMark], obstacles: list[ObstacleMark]) -> CdrMessage:
    """Return visualization_msgs/MarkerArray in `map`; ids are robots' ids, so that a marker replaces its last one."""
    places = {one.robot: one.at for one in robots}
    marks = []
    for one in robots:
        colour = ROLES.get(one.role, ROLES["waiting"])
        name = f"{one.robot} {one.role}" if one.role != "follower" else str(one.robot)
        marks.append(_Marker("robots", one.robot, _ARROW, one.at, (0.4, 0.08, 0.08), colour))
        marks.append(_Marker("names", one.robot, _TEXT, one.at, (0.0, 0.0, 0.2), NAME, text=name))
        if one.slot is not None:
            marks.append(_Marker("slots", one.robot, _CYLINDER, one.slot, (0.2, 0.2, 0.02), SLOT))
        ahead = places.get(one.predecessor) if one.predecessor is not None else None
        if ahead is not None:
            line = ((one.at.x, one.at.y), (ahead.x, ahead.y))
            marks.append(_Marker("predecessors", one.robot, _LINES, Pose2D(), (0.02, 0.0, 0.0), LINE, points=line))
    for n, body in enumerate(obstacles):
        size = (2.0 * body.radius_m, 2.0 * body.radius_m, HEIGHT_M)
        marks.append(_Marker("obstacles", n, _CYLINDER, Pose2D(body.x, body.y), size, OBSTACLE))
    out = CdrWriter().int32(len(marks))
    for mark in marks:
        mark.write(out, stamp_ns)
    return out.message("visualization_msgs/msg/MarkerArray")


class _Marker(NamedTuple):
    """Marker in `map`: namespace and id, shape, pose, size [m], colour; the ends of its lines [m], its text."""

    namespace: str
    number: int
    shape: int
    at: Pose2D
    size: tuple[float, float, float]
    colour: Colour
    points: tuple[tuple[float, float], ...] = ()
    text: str = ""

    def write(self, out: CdrWriter, stamp_ns: int) -> None:
        """Write the fields of visualization_msgs/Marker in their order; it has neither texture nor mesh."""
        add, height = 0, 3.0 * HEIGHT_M if self.text else HEIGHT_M
        x, y, *turn = placed(self.at)
        out.time(stamp_ns).string("map", self.namespace).int32(shown_id(self.number), self.shape, add)
        out.float64(x, y, height, 0.0, 0.0, *turn, *self.size)
        out.float32(*self.colour).int32(LIFETIME_S, 0).int8(_UNLOCKED)
        out.int32(len(self.points))
        for end in self.points:
            out.float64(*end, 0.0)
        out.align(4).octets(_NO_TEXTURE)
        no_mesh_bytes = 0
        out.string(self.text, "", "").int32(no_mesh_bytes).int8(_NO_MATERIALS)
