"""Conversion of a fleet's messages to rerun entities; the same code serves a running fleet and a recording.

Everything is drawn in `map`, on the floor of a 3-D view that is seen from above: a 2-D view of rerun has y downwards.
Rows are collected per entity and sent together by `flush`. Entities: `world/robotN` (pose, with its body, role and scan
below), `slots`, `links` and `trails` of each robot, `map` and `planned` of the leader on unknown ground, `errors`,
`speeds`, `lease`, `radio`, `processes` and `log`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from math import atan2, cos, hypot, nan, pi, sin
from typing import Any

import numpy as np
import rerun as rr

from lfa.deploy.client.radio_loss import RadioLoss
from lfa.deploy.client.team_status import event_text
from lfa.deploy.client.term_count import TermCount
from lfa.deploy.robot_colours import Colour, robot_colour
from lfa.deploy.view.rerun import static_scene
from lfa.deploy.view.rerun.static_scene import flat
from lfa.protocol.geometry import wrap
from lfa.protocol.mission import Mission
from lfa.protocol.names import robot_id_of
from lfa.world.description.scenario import WorldSpec

APPLICATION = "lfa"
TIMELINE = "time"
TOPICS = frozenset({"pose", "tracking", "scan", "event", "status", "truth", "mission", "plan"})
TRAIL_STEP_M, TRAIL_POINTS_MAX = 0.15, 150
SPEED_EVERY = 5
NAMED_MAX = 10  # more names than this would hide the robots
SOFT, GHOST = (150, 150, 150), (190, 190, 190)
BODY_M = 0.1
"""Height [m] of a robot's disc."""
DOT = rr.components.Radius.ui_points(4.5)
"""A robot is never drawn smaller, however far the view is zoomed out: below its disc, which hides it when near."""
INK = (20, 20, 20)
"""Names are dark, for the viewer draws them on grey."""
NAME_M, NAME = 0.7, 0.04
"""The name of a way-point is this far above, that of the goal behind it, more on a long route, which is shown smaller:
clear of a robot that is there, of its name below, and of those that follow."""
OUTLINE = rr.components.Radius.ui_points(1.8)
"""Line width of a robot's outline, visible at any zoom."""
ROUTE, TRAIL = rr.components.Radius.ui_points(1.0), rr.components.Radius.ui_points(1.3)
LEADS, FOLLOWS, WAITS, GONE = (230, 159, 0), (0, 114, 178), (130, 130, 130), (200, 60, 40)
PLANNED = (204, 121, 167)
ROLE_COLOURS = {"leader": LEADS, "follower": FOLLOWS, "waiting": WAITS, "gone": GONE}
ALARMS = ("fault", "contact", "failed", "died", "slowed")


class Scene:
    """Scene of one fleet, drawn into one recording stream."""

    def __init__(self, stream: rr.RecordingStream) -> None:
        self._stream = stream
        self._radius_m = Mission().radius_m
        self._where: dict[int, tuple[float, float, float]] = {}
        self._true = False
        self._trails: dict[int, deque[tuple[float, float]]] = {}
        self._counts: dict[str, int] = {}
        self._roles: dict[int, str] = {}
        self._leader = ""
        self._terms = TermCount()
        self._planner = ""
        self._angles: dict[str, float] = {}
        self._radio = RadioLoss()
        self._rows: dict[tuple[str, str], list[tuple[float, Any]]] = {}
        self._mission_known = False
        self._named = True
        self._colours: dict[int, Colour] = {}
        self._placed: set[int] = set()

    # --- static entities -------------------------------------------------------------------------------------------

    def ground(self, world: WorldSpec) -> None:
        """Draw walls, terrain and obstacles."""
        for entity, what in static_scene.standing(world):
            self._always(entity, what)
        for index, obstacle in enumerate(world.obstacles):
            if static_scene.moves(obstacle):
                self._row("transform", f"world/obstacles/{index}", 0.0, (*obstacle.center_m, 0.0))

    def mission(self, mission: Any) -> None:
        """Draw route and goal; only the first call has an effect."""
        if self._mission_known:
            return
        self._mission_known, self._radius_m = True, float(mission.radius_m)
        self._named = len(mission.robots) <= NAMED_MAX
        route = [(float(x), float(y)) for x, y in mission.leading.route_m]
        off_m = max(NAME_M, NAME * max(hypot(x, y) for x, y in route))
        if mission.leading.motion != "explore":  # an exploring leader's route is drawn as `planned`
            self._always("world/route", rr.LineStrips3D([flat([(0.0, 0.0), *route])], colors=SOFT, radii=ROUTE))
        if route[:-1]:
            self._always("world/way-points", rr.Points3D(flat(route[:-1]), colors=SOFT, radii=0.08))
            if len(route) <= NAMED_MAX:
                above = [(x, y + off_m) for x, y in route[:-1]]
                names = _names(above, [f"{n}" for n in range(1, len(route))])
                self._always("world/way-points/names", names)
        self._always("world/goal", rr.Points3D(flat(route[-1:]), colors=LEADS, radii=0.15))
        self._always("world/goal/name", _names([_behind(route, off_m)], ["goal"]))
        for n, robot in enumerate(mission.robots):
            self._dress(robot, n, len(mission.robots))

    def _dress(self, robot: int, n: int, of: int) -> None:
        """Set the static colours, widths and names of a robot's entities."""
        colour = self._colours[robot] = robot_colour(n, of)
        for series in ("errors/distance", "errors/bearing", "errors/heading", "speeds", "processes/lag", "radio"):
            self._always(f"{series}/robot{robot}", rr.SeriesLines(colors=colour, names=f"robot {robot}", widths=1.5))
        names, colours = list(ROLE_COLOURS), list(ROLE_COLOURS.values())
        self._always(f"lease/robot{robot}", rr.StateConfiguration(values=names, colors=colours))
        self._always(f"world/trails/robot{robot}", rr.LineStrips3D.from_fields(colors=colour, radii=TRAIL))
        self._always(f"world/slots/robot{robot}", rr.Points3D.from_fields(colors=GHOST, radii=0.08))
        self._always(f"world/links/robot{robot}", rr.LineStrips3D.from_fields(colors=SOFT, radii=TRAIL))
        self._always(f"world/robot{robot}/scan", rr.Points3D.from_fields(colors=colour, radii=0.03))

    # --- messages --------------------------------------------------------------------------------------------------

    def see(self, t: float, owner: str, topic: str, message: Any) -> None:
        """Update the scene with a message, live or read from a recording, at world time `t` [s]."""
        robot = robot_id_of(owner)
        match topic:
            case "truth":
                self._truth(t, message)
            case "mission":
                self.mission(message.mission)
            case "event":
                self._event(t, owner, message)
            case "pose" if robot:
                self._pose(t, robot, message)
            case "tracking" if robot:
                self._tracking(t, robot, message)
            case "scan" if robot:
                self._scan(t, robot, message)
            case "status" if robot:
                self._status(t, robot, message.counters)
            case "plan" if robot:
                self._plan(t, owner, message)

    def flush(self) -> None:
        """Send all collected rows to the stream."""
        rows, self._rows = self._rows, {}
        for (kind, entity), of_entity in rows.items():
            times = rr.TimeColumn(TIMELINE, duration=np.array([t for t, _ in of_entity]))
            columns = _COLUMNS[kind]([row for _, row in of_entity])
            self._stream.send_columns(entity, indexes=[times], columns=columns)

    def _truth(self, t: float, message: Any) -> None:
        self._true = True
        for r in message.robots:
            self._where[r.id] = (r.x, r.y, r.theta)
        for body in message.obstacles:
            if self._every(f"obstacle{body.index}", SPEED_EVERY):
                self._row("transform", f"world/obstacles/{body.index}", t, (body.x, body.y, 0.0))

    def _pose(self, t: float, robot: int, message: Any) -> None:
        x, y, theta = float(message.x), float(message.y), float(message.theta)
        if not self._true:
            self._where[robot] = (x, y, theta)
        if robot not in self._roles:
            self._role(t, robot, str(message.role))
        self._row("transform", f"world/robot{robot}", t, (x, y, theta))
        if self._named:  # beside the robot's own frame, which turns: below the robot, whatever its heading
            self._row("points", f"world/names/robot{robot}", t, np.array([[x, y - 1.5 * self._radius_m, BODY_M]]))
        if robot not in self._placed:  # before its first pose it would be drawn at the origin
            self._placed.add(robot)
            self._body(t, robot, self._roles[robot])
        self._trail(t, robot, x, y)
        if self._every(f"speed{robot}", SPEED_EVERY):
            self._row("scalar", f"speeds/robot{robot}", t, float(message.twist.linear_x))

    def _trail(self, t: float, robot: int, x: float, y: float) -> None:
        trail = self._trails.setdefault(robot, deque(maxlen=TRAIL_POINTS_MAX))
        if not trail or hypot(x - trail[-1][0], y - trail[-1][1]) >= TRAIL_STEP_M:
            trail.append((x, y))
            if len(trail) > 1:
                self._row("strip", f"world/trails/robot{robot}", t, flat(trail, 0.01))

    def _tracking(self, t: float, robot: int, message: Any) -> None:
        slot = message.slot_map
        self._row("points", f"world/slots/robot{robot}", t, np.array([[float(slot.x), float(slot.y), 0.01]]))
        own, ahead = self._where.get(robot), self._where.get(message.predecessor)
        if own is None or ahead is None:
            return
        dx, dy = own[0] - ahead[0], own[1] - ahead[1]
        self._row("strip", f"world/links/robot{robot}", t, flat([own[:2], ahead[:2]], 0.02))
        bearing = wrap(atan2(dy, dx) - float(message.chi) - float(message.phi))
        self._row("scalar", f"errors/distance/robot{robot}", t, hypot(dx, dy) - float(message.separation_m))
        self._angle(f"errors/bearing/robot{robot}", t, bearing)
        self._angle(f"errors/heading/robot{robot}", t, wrap(float(message.heading) - own[2]))

    def _angle(self, entity: str, t: float, angle: float) -> None:
        """Add an angle [rad], drawn in degrees, with a gap in the line where it wraps at +-180."""
        before = self._angles.get(entity, angle)
        self._angles[entity] = angle
        self._row("scalar", entity, t, nan if abs(angle - before) > pi else angle * 180.0 / pi)

    def _scan(self, t: float, robot: int, message: Any) -> None:
        ranges = np.array(message.ranges_m, dtype=object).astype(np.float32)
        hit = np.flatnonzero(np.isfinite(ranges))
        angles = float(message.angle_min) + float(message.angle_increment) * hit
        points = np.stack([ranges[hit] * np.cos(angles), ranges[hit] * np.sin(angles), 0.0 * ranges[hit]], axis=1)
        self._row("points", f"world/robot{robot}/scan", t, points)

    def _status(self, t: float, robot: int, counters: dict[str, Any]) -> None:
        self._row("scalar", f"processes/lag/robot{robot}", t, float(counters.get("loop_lag_ms", 0.0)))
        share = self._radio.share(t, robot, counters)
        if share is not None:
            self._row("scalar", f"radio/robot{robot}", t, 100.0 * share)

    def _plan(self, t: float, owner: str, message: Any) -> None:
        """Draw the leader's route and one tile of its map; the tiles of an earlier leader are cleared."""
        if owner != self._planner:
            self._say(t, "world/map/tiles", rr.Clear(recursive=True))
            self._planner = owner
        cell_m, cells = float(message.cell_m), message.cells
        x, y = (float(value) for value in message.corner_map)
        route = [(float(px), float(py)) for px, py in message.route_map]
        self._say(t, "world/planned", rr.LineStrips3D([flat(route, 0.01)], colors=PLANNED, radii=0.03))
        entity = f"world/map/tiles/{owner}/{x:.1f}_{y:.1f}"
        self._say(t, entity, static_scene.placed((x, y), cell_m))
        self._say(t, entity, static_scene.tile(message.columns, cells))

    def _event(self, t: float, owner: str, message: Any) -> None:
        data, kind = message.data, message.kind
        robot = data.get("robot") if isinstance(data.get("robot"), int) else robot_id_of(owner)
        if kind == "role" and robot:
            self._role(t, robot, str(data.get("role")))
        elif robot and (kind == "died" or (kind == "fault" and data.get("deed") in ("kill", "terminate"))):
            self._role(t, robot, "gone")
        elif kind == "leader_command" and robot and message.term is not None:
            self._lead(t, robot, message.term.n)
        text = event_text(owner, kind, data)
        if text is not None:
            self._say(t, "log", rr.TextLog(text, level="WARN" if kind in ALARMS else "INFO"))

    def _role(self, t: float, robot: int, role: str) -> None:
        if self._roles.get(robot) == role:
            return
        self._roles[robot] = role
        if role != "follower":
            for entity in (f"world/slots/robot{robot}", f"world/links/robot{robot}"):
                self._say(t, entity, rr.Clear(recursive=False))
        if robot in self._placed:
            self._body(t, robot, role)
        self._say(t, f"lease/robot{robot}", rr.StateChange(state=role))

    def _body(self, t: float, robot: int, role: str) -> None:
        """Draw a robot as a disc in its own colour with a white line ahead, and its role as a ring around it."""
        r, colour = self._radius_m, self._colours.get(robot, WAITS) if role != "gone" else WAITS
        ring = static_scene.circle(1.3 * r)
        nose = [(0.0, 0.0), (0.9 * r, 0.0)]
        disc = rr.Cylinders3D(lengths=BODY_M, radii=r, colors=colour, fill_mode=rr.components.FillMode.Solid)
        self._say(t, f"world/robot{robot}/body", disc)
        lines, widths = [flat([*ring, ring[0]], BODY_M), flat(nose, BODY_M)], np.append(OUTLINE, 0.15 * r)
        colours = [ROLE_COLOURS.get(role, WAITS), (255, 255, 255)]
        self._say(t, f"world/robot{robot}/role", rr.LineStrips3D(lines, colors=colours, radii=widths))
        self._say(t, f"world/robot{robot}/dot", rr.Points3D([(0.0, 0.0, 0.0)], colors=colour, radii=DOT))
        if self._named:
            name = f"{robot}" if role == "follower" else f"{robot} {role}"
            self._say(t, f"world/names/robot{robot}", rr.Points3D.from_fields(colors=INK, radii=0.0, labels=[name]))

    def _lead(self, t: float, robot: int, term: int) -> None:
        leader = f"robot {robot}, term {self._terms.number(term)}"
        if leader != self._leader:
            self._leader = leader
            self._say(t, "lease/leader", rr.StateChange(state=leader))

    # --- output to rerun -------------------------------------------------------------------------------------------

    def _every(self, what: str, nth: int) -> bool:
        count = self._counts.get(what, 0)
        self._counts[what] = count + 1
        return count % nth == 0

    def _row(self, kind: str, entity: str, t: float, row: Any) -> None:
        self._rows.setdefault((kind, entity), []).append((t, row))

    def _always(self, entity: str, what: Any) -> None:
        self._stream.log(entity, what, static=True)

    def _say(self, t: float, entity: str, what: Any) -> None:
        self._stream.set_time(TIMELINE, duration=t)
        self._stream.log(entity, what)


def _names(points: Sequence[tuple[float, float]], names: list[str]) -> Any:
    return rr.Points3D(flat(points, 0.01), colors=INK, radii=0.0, labels=names)


def _behind(route: Sequence[tuple[float, float]], off_m: float) -> tuple[float, float]:
    """Return a point behind the end of `route`, a little above its line: the viewer draws a name below its point."""
    (from_x, from_y), (x, y) = ((0.0, 0.0), *route)[-2:]
    heading = atan2(y - from_y, x - from_x)
    return x + 1.1 * off_m * cos(heading), y + off_m * (0.35 + 0.65 * sin(heading))


def _transforms(rows: Sequence[tuple[float, float, float]]) -> Any:
    poses = np.array(rows)
    half = 0.5 * poses[:, 2]
    zero = np.zeros_like(half)
    translation = np.stack([poses[:, 0], poses[:, 1], zero], axis=1)
    quaternion = np.stack([zero, zero, np.sin(half), np.cos(half)], axis=1)
    return rr.Transform3D.columns(translation=translation, quaternion=quaternion)


def _points(rows: Sequence[Any]) -> Any:
    return rr.Points3D.columns(positions=np.concatenate(rows)).partition([len(row) for row in rows])


_COLUMNS: dict[str, Callable[[Any], Any]] = {
    "transform": _transforms,
    "points": _points,
    "strip": lambda rows: rr.LineStrips3D.columns(strips=rows),
    "scalar": lambda rows: rr.Scalars.columns(scalars=rows),
}
