"""Picture of a team for the page: frames many times a second, and news of what happened, from any source of messages.

The same picture is fed by the simulator, by a running fleet and by a recording. A frame is plain lists, for JSON: of
each robot the columns `COLUMNS`. Pure: times come with the messages.
"""

from __future__ import annotations

from base64 import b64encode
from contextlib import suppress
from math import atan2, hypot, isfinite
from typing import Any

from msgspec import Struct

from lfa.deploy.client.radio_loss import RadioLoss
from lfa.deploy.client.team_status import event_text
from lfa.deploy.faults.link_faults import links
from lfa.deploy.view.picture.leaders import LeaderTable
from lfa.deploy.view.picture.news import News
from lfa.protocol.errors import Refused
from lfa.protocol.geometry import wrap
from lfa.protocol.names import robot_id_of, robot_name

TOPICS = frozenset({"pose", "tracking", "event", "status", "truth", "plan", "scan", "team_order"})
"""Topics that a picture is drawn from."""
COLUMNS = (
    "id", "x", "y", "theta", "speed", "role", "ahead", "slot_x", "slot_y", "distance", "bearing", "heading", "loss",
    "cut",
)  # fmt: skip
"""Of each robot: m, m, rad, m/s; role; predecessor's id; slot [m]; errors [m], [rad], [rad]; share of lost rows; 1 if
cut off from another robot."""
TRACKED_S = 0.5
"""Age [s] up to which a follower's slot is drawn."""
ALARMS = ("fault", "contact", "failed", "died", "slowed", "order_refused")
SILENT = ("leader_command",)
"""Events that the page tells otherwise: the change of a leader has a table of its own."""
CM = 100.0


class _Robot(Struct):
    """What the page shows of one robot."""

    x: float = 0.0
    y: float = 0.0
    theta: float = 0.0
    speed: float = 0.0
    role: str = "waiting"
    placed: bool = False
    ahead: int = 0
    slot: tuple[float, float] | None = None
    errors: tuple[float, float, float] = (0.0, 0.0, 0.0)
    tracked_at: float = -1.0
    loss: float = 0.0
    stopped: bool = False
    gone: bool = False


class Picture:
    """Picture of one team, updated by `see`; `news` has what happened, `frame` what is now."""

    def __init__(self, robots: tuple[int, ...], *, late: bool = False) -> None:
        """`late`: a leader that led before the first message is known by its own poses."""
        self.t = 0.0
        self.news = News()
        self.leaders = LeaderTable()
        self.wanted_scans: set[int] = set()
        """Robots whose scans are part of the frames."""
        self.decisions: dict[str, int] = {}
        """Number of decisions so far, by action."""
        self.contacts = 0
        self.added: list[tuple[float, float, float]] = []
        """Obstacles that were set down during the run: x, y, radius [m]."""
        self.sides: list[tuple[float, str]] = []
        """Formations that leaders have ordered, each with its time [s]."""
        self.chain: tuple[int, ...] = ()
        """Chain of the newest config, leader first."""
        self._version = (0, 0, 0)
        self.loss_ordered = 0.0
        """Share of messages that an order lets every receiver lose."""
        self._route = 0
        """Version of the order that gave the route; 0: the mission's own."""
        self._ids = robots
        self._late = late
        self._robots = {robot: _Robot() for robot in robots}
        self._true = False
        self._moved: dict[int, tuple[float, float]] = {}
        self._cuts: set[tuple[str, str]] = set()
        self._radio = RadioLoss()
        self._scans: dict[int, Any] = {}

    @property
    def robots(self) -> tuple[int, ...]:
        return self._ids

    @property
    def is_cut(self) -> bool:
        """True while an order cuts some robots off from others."""
        return bool(self._cuts)

    @property
    def leader(self) -> int | None:
        """Robot whose leader command was accepted last, unless its process is known to be gone."""
        robot = self.leaders.leader
        return None if robot is None or robot not in self._robots or self._robots[robot].gone else robot

    def role(self, robot: int) -> str:
        """Return what the page shows a robot as: its role, `stopped` or `gone`."""
        shown = self._robots[robot]
        return "gone" if shown.gone else "stopped" if shown.stopped else shown.role

    def speed(self, robot: int) -> float:
        return self._robots[robot].speed

    def distance_error_m(self, robot: int) -> float:
        return self._robots[robot].errors[0]

    def where(self, robot: int) -> tuple[float, float] | None:
        """Return the position x, y [m] of a robot, None if it is not known yet."""
        shown = self._robots[robot]
        return (shown.x, shown.y) if shown.placed else None

    def frame(self) -> dict[str, Any]:
        """Return the present state for the page."""
        frame: dict[str, Any] = {
            "t": round(self.t, 3),
            "robots": [self._row(robot, shown) for robot, shown in self._robots.items() if shown.placed],
            "leader": self.leader,
            "term": self.leaders.term,
        }
        if self._moved:
            frame["moved"] = [[n, round(x, 3), round(y, 3)] for n, (x, y) in self._moved.items()]
        wanted = [robot for robot in self.wanted_scans if robot in self._scans]
        if wanted:
            frame["scans"] = {robot: _scan_row(self._scans[robot]) for robot in wanted}
        return frame

    def _row(self, robot: int, shown: _Robot) -> list[Any]:
        fresh = shown.slot is not None and self.t - shown.tracked_at < TRACKED_S and not shown.gone
        slot = shown.slot if fresh and shown.slot is not None else (None, None)
        errors = [round(error, 4) for error in shown.errors] if fresh else [None, None, None]
        name = robot_name(robot)
        cut = int(any(name in pair for pair in self._cuts))
        where = [robot, round(shown.x, 3), round(shown.y, 3), round(shown.theta, 3), round(shown.speed, 3)]
        ahead = shown.ahead if fresh else 0
        return [*where, self.role(robot), ahead, *slot, *errors, round(shown.loss, 3), cut]

    def see(self, t: float, owner: str, topic: str, message: Any) -> None:
        """Update with a message at time `t` [s] of the run, live or read from a recording."""
        robot = robot_id_of(owner)
        match topic:
            case "truth":
                self._truth(t, message)
            case "event":
                self._event(t, owner, message)
            case "pose" if robot in self._robots:
                self._pose(t, self._robots[robot], message)
                if self._late and self._robots[robot].role == "leader":
                    self._found(t, robot, message)
            case "tracking" if robot in self._robots:
                self._tracking(t, self._robots[robot], message)
            case "status" if robot in self._robots:
                self._robots[robot].loss = self._radio.share(t, robot, message.counters) or 0.0
            case "plan" if robot in self._robots:
                self._plan(message)
            case "scan" if robot in self._robots:
                self._scans[robot] = message
            case "team_order" if message.term is not None:
                self._order(message.order)

    def _truth(self, t: float, message: Any) -> None:
        self._true = True
        self.t = max(self.t, t)
        for true in message.robots:
            shown = self._robots.get(true.id)
            if shown is not None:
                shown.x, shown.y, shown.theta, shown.speed = true.x, true.y, true.theta, true.linear_x
                shown.placed = True
        for body in message.obstacles:
            self._moved[body.index] = (body.x, body.y)

    def _pose(self, t: float, shown: _Robot, message: Any) -> None:
        self.t = max(self.t, t)
        shown.role = str(message.role.value if hasattr(message.role, "value") else message.role)
        if not self._true:
            shown.x, shown.y, shown.theta = float(message.x), float(message.y), float(message.theta)
            shown.speed, shown.placed = float(message.twist.linear_x), True

    def _found(self, t: float, robot: int, message: Any) -> None:
        lead = self.leaders.found(t, robot, (int(message.term.n), int(message.term.issuer)))
        if lead is not None:
            self.news.add({"k": "lead", **lead})

    def _tracking(self, t: float, shown: _Robot, message: Any) -> None:
        ahead = self._robots.get(message.predecessor)
        shown.ahead, shown.tracked_at = int(message.predecessor), t
        shown.slot = (round(float(message.slot_map.x), 3), round(float(message.slot_map.y), 3))
        if ahead is None or not (ahead.placed and shown.placed):
            return
        dx, dy = shown.x - ahead.x, shown.y - ahead.y
        bearing = wrap(atan2(dy, dx) - float(message.chi) - float(message.phi))
        heading = wrap(float(message.heading) - shown.theta)
        shown.errors = (hypot(dx, dy) - float(message.separation_m), bearing, heading)

    def _plan(self, message: Any) -> None:
        route = [[round(float(x), 2), round(float(y), 2)] for x, y in message.route_map]
        self.news.add({"k": "plan", "route": route}, "plan")
        x, y = (round(float(value), 3) for value in message.corner_map)
        cells = b64encode(bytes(message.cells)).decode()
        tile = {"k": "tile", "x": x, "y": y, "cell_m": float(message.cell_m), "columns": int(message.columns)}
        self.news.add({**tile, "cells": cells}, f"tile {x} {y}")

    def _order(self, order: Any) -> None:
        """Note another route or goal, once; a leader says its order again each second (E32)."""
        route = [[round(float(x), 3), round(float(y), 3)] for x, y in order.leading.route_m]
        if int(order.route) > self._route:
            self._route = int(order.route)
            self.news.add({"k": "route", "route": route, "goal": route[-1]}, "route")

    def _event(self, t: float, owner: str, message: Any) -> None:
        data, kind = dict(message.data), str(message.kind)
        said = data.get("robot")
        robot = said if isinstance(said, int) else robot_id_of(owner)
        lead = self.leaders.see(t, owner, message)
        if lead is not None:
            self.news.add({"k": "lead", **lead})
        changed = False
        match kind:
            case "fault":
                self._fault(str(data.get("deed")), data.get("robot"))
            case "died" if robot in self._robots:
                self._robots[robot].gone = True
            case "role" if robot in self._robots:
                self._robots[robot].role = str(data.get("role"))
            case "obstacle" if "refused" not in data:
                self._obstacle(data)
            case "decision":
                action = str(data.get("action"))
                self.decisions[action] = self.decisions.get(action, 0) + 1
            case "contact":
                self.contacts += 1
            case "formation" if data.get("side"):
                self.sides.append((t, str(data["side"])))
            case "chain" if isinstance(data.get("chain"), list | tuple) and message.term is not None:
                seq = data.get("seq")
                version = (int(message.term.n), int(message.term.issuer), seq if isinstance(seq, int) else 0)
                changed = version > self._version
                if changed:
                    self._version = version
                    self.chain = tuple(one for one in data["chain"] if isinstance(one, int))
        facts = {name: value for name, value in data.items() if name != "robot" or kind == "fault"}
        echo = (kind == "formation" and "side" not in data) or (kind == "chain" and not changed)
        text = None if kind in SILENT or echo else event_text("", kind, facts)
        if text is not None:
            alarm = kind in ALARMS or "refused" in data
            self.news.add({"k": "event", "t": round(t, 3), "kind": kind, "who": robot, "text": text, "alarm": alarm})

    def _obstacle(self, data: dict[str, Any]) -> None:
        numbers = [data.get(name) for name in ("index", "x", "y", "radius_m")]
        if all(isinstance(number, int | float) for number in numbers):
            self.added.append((float(data["x"]), float(data["y"]), float(data["radius_m"])))
            self.news.add({"k": "obstacle", **dict(zip(("index", "x", "y", "radius_m"), numbers, strict=True))})

    def _fault(self, action: str, target: Any) -> None:
        shown = self._robots.get(target) if isinstance(target, int) else None
        match action:
            case "loss":
                with suppress(ValueError, TypeError):  # any sender may have written it
                    self.loss_ordered = float(target) if target else 0.0
            case "cut" | "heal":
                self.loss_ordered = self.loss_ordered if target else 0.0
                self._cut(action, "" if target is None else str(target))
            case "kill" | "terminate" if shown is not None:
                shown.gone, shown.stopped = True, False
            case "restart" if shown is not None:
                shown.gone, shown.stopped, shown.role = False, False, "waiting"
            case "stop" | "continue" if shown is not None:
                shown.stopped = action == "stop"

    def _cut(self, action: str, target: str) -> None:
        try:
            named = set(links(target, self._ids)) if target else set()
        except Refused:
            return
        self._cuts = self._cuts | named if action == "cut" else self._cuts - named if named else set()


def _scan_row(scan: Any) -> list[Any]:
    """Return first angle [rad], increment [rad] and ranges [cm] of a laser scan, 0 for a beam without a range."""
    ranges = [round(CM * r) if isfinite(CM * r) else 0 for r in map(float, scan.ranges_m)]
    return [float(scan.angle_min), float(scan.angle_increment), ranges]
