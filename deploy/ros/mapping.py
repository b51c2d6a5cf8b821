"""The one mapping from a fleet's messages to ROS messages, for the bridge, bags and Foxglove. Pure.

Times are UNIX nanoseconds, or world time from 0 for `--sim-time` and bags: `stamp_ns` is the sender's stamp on that
clock. A message is only built when `heard(topic)` is True.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from lfa.deploy.client.team_status import event_text
from lfa.deploy.ros import markers, messages
from lfa.deploy.ros.cdr import NS, CdrMessage
from lfa.deploy.ros.explored import ExploredMap
from lfa.deploy.ros.markers import ObstacleMark, RobotMark
from lfa.deploy.ros.messages import Transform
from lfa.deploy.ros.robot_view import STALE_NS, RobotView
from lfa.protocol.geometry import Pose2D
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.consensus import LeaseNote, Propose, Role, Version
from lfa.protocol.messages.robot import CmdVel, LaserScan, Sensors
from lfa.protocol.messages.team import Event, MissionNote, ObstacleNote, PlanNote, PoseStamped, Status, Tracking
from lfa.protocol.mission import Mission
from lfa.protocol.names import robot_id_of

CLOCK_NS, MARKERS_NS, SECOND_NS = NS // 50, NS // 5, NS
TF_NS = NS // 50
"""Time [ns] after which transforms wait no longer for those of other robots."""
TF_APART_NS = TF_NS * 3 // 4
"""Least time [ns] between two messages of transforms, should odometry come faster than 50 Hz."""
OBSTACLES_MAX = 64
ROBOTS_MAX = 256
WARNINGS = frozenset({"contact", "stuck", "slowed", "late", "rate", "refused", "input", "left_out", "fault"})
ERRORS = frozenset({"failed", "died"})


class RosMessage(NamedTuple):
    """Message for a topic, with the time [ns] at which it is published."""

    topic: str
    stamp_ns: int
    message: CdrMessage


class FleetMapping:
    """State of one fleet as ROS shows it; `update` takes its messages, `tick` returns what is due by time."""

    def __init__(
        self, *, tf_per_robot: bool = False, sim_time: bool = False, heard: Callable[[str], bool] = lambda topic: True
    ) -> None:
        self._tf_per_robot = tf_per_robot
        self._sim_time = sim_time
        self._heard = heard
        self._robots: dict[int, RobotView] = {}
        self._mission = Mission()
        self._due: dict[str, int] = {}
        self._map = ExploredMap()
        self._obstacles: dict[tuple[str, int, int], tuple[int, ObstacleMark]] = {}
        self._chain: tuple[Version, tuple[int, ...]] | None = None
        self._leader: int | None = None
        self._static_changed = False
        self._described: set[int] = set()
        self._tf_at = -TF_NS
        self._tf_waits_since: int | None = None
        """Time [ns] since which some robot's odometry is new."""

    @property
    def robots(self) -> tuple[int, ...]:
        return tuple(sorted(self._robots))

    @property
    def leader(self) -> int:
        """Robot that leads by its own fresh claim; 0: none."""
        return self._leader or 0

    def forget(self, robot: int) -> None:
        """Remove a robot that left the fleet."""
        self._robots.pop(robot, None)
        self._described.discard(robot)

    def set_mission(self, mission: Mission) -> None:
        """Take the mission: the robots' size and the leader's route."""
        self._mission = mission
        self._described.clear()

    def update(self, stamp_ns: int, owner: str, message: Message) -> list[RosMessage]:
        """Take a message of the key owner `owner`, stamped `stamp_ns`; return the ROS messages that it becomes."""
        robot = robot_id_of(owner)
        view = self._view(robot) if robot else None
        match message:
            case Sensors() if view is not None:
                return self._sensors(stamp_ns, view, message)
            case PoseStamped() if view is not None:
                return self._pose(stamp_ns, view, message)
            case CmdVel() if view is not None:
                return self._command(stamp_ns, view, message)
            case LaserScan() if view is not None and self._heard(f"{view.namespace}/scan"):
                return [
                    RosMessage(f"{view.namespace}/scan", stamp_ns, messages.laser_scan(stamp_ns, message, view.laser))
                ]
            case Tracking() if view is not None:
                view.tracking = (stamp_ns, message)
            case Status() if view is not None:
                view.status = message
            case PlanNote() if view is not None:
                return self._plan(stamp_ns, view, message)
            case LeaseNote(body=Propose(config=config)):
                return self._config(stamp_ns, config.version, tuple(member.id for member in config.chain))
            case ObstacleNote():
                self._obstacle(stamp_ns, owner, message)
            case MissionNote(mission=mission):
                self.set_mission(mission)
            case Event():
                return self._event(stamp_ns, owner, message)
        return []

    def tick(self, now_ns: int) -> list[RosMessage]:
        """Return what is due at `now_ns`: transforms, markers, trails, diagnostics, the leader, the map, the clock."""
        sent: list[RosMessage] = []
        if self._transforms_due(now_ns):
            sent += self._transforms(now_ns)
        if self._sim_time and self._every("clock", CLOCK_NS, now_ns) and self._heard("/clock"):
            sent.append(RosMessage("/clock", now_ns, messages.clock(now_ns)))
        if self._every("markers", MARKERS_NS, now_ns):
            sent += self._leading(now_ns)
            if self._heard("/lfa/formation"):
                sent.append(RosMessage("/lfa/formation", now_ns, self._formation(now_ns)))
        if self._every("second", SECOND_NS, now_ns):
            sent += [*self._descriptions(now_ns), *self._slow(now_ns)]
        return sent

    # --- per message ------------------------------------------------------------------------------------------------

    def _sensors(self, stamp_ns: int, view: RobotView, message: Sensors) -> list[RosMessage]:
        view.move(stamp_ns, message)
        topic = f"{view.namespace}/odom"
        if not self._heard(topic):
            return []
        at, of, odometer_m = message.pose_odom, message.twist, message.odometer_m
        return [RosMessage(topic, stamp_ns, messages.odometry(stamp_ns, at, of, odometer_m, view.odom, view.base))]

    def _pose(self, stamp_ns: int, view: RobotView, message: PoseStamped) -> list[RosMessage]:
        at = view.place(stamp_ns, message)
        topic = f"{view.namespace}/pose"
        return [RosMessage(topic, stamp_ns, messages.pose_stamped(stamp_ns, at))] if self._heard(topic) else []

    def _command(self, stamp_ns: int, view: RobotView, message: CmdVel) -> list[RosMessage]:
        topic = f"{view.namespace}/cmd_vel"
        if view.refuses(message) or not self._heard(topic):
            return []
        return [RosMessage(topic, stamp_ns, messages.twist_stamped(stamp_ns, message.twist, view.base))]

    def _plan(self, stamp_ns: int, view: RobotView, message: PlanNote) -> list[RosMessage]:
        self._map.update(message)
        route = [Pose2D(x, y) for x, y in message.route_map]
        return [RosMessage(f"{view.namespace}/plan", stamp_ns, messages.path(stamp_ns, route))]

    def _config(self, stamp_ns: int, version: Version, chain: tuple[int, ...]) -> list[RosMessage]:
        before, self._chain = self._chain, max(self._chain or (version, chain), (version, chain))
        if before is not None and before[1] == self._chain[1]:
            return []
        words = " ".join(map(str, self._chain[1]))
        return [RosMessage("/lfa/chain", stamp_ns, messages.text(words))]

    def _obstacle(self, stamp_ns: int, owner: str, message: ObstacleNote) -> None:
        if len(self._obstacles) >= OBSTACLES_MAX:
            self._obstacles.pop(next(iter(self._obstacles)))
        place = (owner, round(message.x), round(message.y))
        self._obstacles[place] = (stamp_ns, ObstacleMark(message.x, message.y, message.radius_m))

    def _event(self, stamp_ns: int, owner: str, message: Event) -> list[RosMessage]:
        words = event_text("", message.kind, message.data)
        if words is None or not self._heard("/rosout"):
            return []
        level = "error" if message.kind in ERRORS else "warn" if message.kind in WARNINGS else "info"
        return [RosMessage("/rosout", stamp_ns, messages.log(stamp_ns, level, owner, words))]

    # --- by time ----------------------------------------------------------------------------------------------------

    def _transforms_due(self, now_ns: int) -> bool:
        """Return True as soon as every robot has new odometry, or once the first that has waited for TF_NS."""
        views = self._robots.values()
        if not any(view.tf_due for view in views) or now_ns - self._tf_at < TF_APART_NS:
            return False
        if self._tf_waits_since is None:
            self._tf_waits_since = now_ns
        late = any(view.moves(now_ns) and not view.tf_due for view in views)
        if late and now_ns - self._tf_waits_since < TF_NS:
            return False
        self._tf_at, self._tf_waits_since = now_ns, None
        return True

    def _transforms(self, now_ns: int) -> list[RosMessage]:
        """Return the transforms of all robots whose odometry is new, in one message or one per robot."""
        sent, of_all = [], []
        for view in self._robots.values():
            topic = f"{view.namespace}/tf" if self._tf_per_robot else "/tf"
            if not view.tf_due or view.sensors is None or not self._heard(topic):
                continue
            view.tf_due = False
            stamp_ns, sensors = view.sensors
            transforms = [Transform(stamp_ns, view.odom, view.base, sensors.pose_odom)]
            if view.map_odom is not None:
                transforms.append(Transform(stamp_ns, "map", view.odom, view.map_odom))
            if self._tf_per_robot:
                sent.append(RosMessage(topic, now_ns, messages.tf(transforms)))
            of_all += transforms
        return sent if self._tf_per_robot or not of_all else [RosMessage("/tf", now_ns, messages.tf(of_all))]

    def _leading(self, now_ns: int) -> list[RosMessage]:
        """Return the leader and its route, when the leader has changed; 0: nobody leads."""
        claims = [
            (pose.term, robot)
            for robot, view in self._robots.items()
            if view.pose is not None and now_ns - view.pose[0] < STALE_NS
            for pose in (view.pose[1],)
            if pose.role is Role.LEADER
        ]
        leader = max(claims)[1] if claims else 0
        if leader == self._leader:
            return []
        self._leader = leader
        sent = [RosMessage("/lfa/leader", now_ns, messages.number(leader))]
        leading = self._mission.leading
        if leader and leading.route_m and leading.motion != "explore":
            route = [Pose2D(x, y) for x, y in leading.route_m]
            sent.append(RosMessage(f"/robot{leader}/plan", now_ns, messages.path(now_ns, route)))
        return sent

    def _formation(self, now_ns: int) -> CdrMessage:
        marks = []
        for robot, view in self._robots.items():
            if view.pose is None or now_ns - view.pose[0] > STALE_NS:
                continue
            pose = view.pose[1]
            follows = pose.role is Role.FOLLOWER and view.tracking and now_ns - view.tracking[0] < STALE_NS
            slot, ahead = (None, None)
            if follows and view.tracking is not None:
                slot, ahead = view.tracking[1].slot_map, view.tracking[1].predecessor
            marks.append(RobotMark(robot, str(pose.role), Pose2D(pose.x, pose.y, pose.theta), slot, ahead))
        fresh = {place: seen for place, seen in self._obstacles.items() if now_ns - seen[0] < STALE_NS}
        self._obstacles = fresh
        return markers.formation(now_ns, marks, [mark for _, mark in fresh.values()])

    def _descriptions(self, now_ns: int) -> list[RosMessage]:
        """Return description and static transforms of robots that are new, or whose mission is."""
        new = set(self._robots) - self._described
        if not new:
            return []
        self._described |= new
        radius_m = self._mission.radius_m
        sent, statics = [], [Transform(now_ns, "world", "map", Pose2D())]
        for robot, view in sorted(self._robots.items()):
            static = Transform(now_ns, view.base, view.laser, Pose2D())
            urdf = messages.text(messages.robot_description(view.base, radius_m))
            if robot in new:
                sent.append(RosMessage(f"{view.namespace}/robot_description", now_ns, urdf))
            if self._tf_per_robot and robot in new:
                sent.append(RosMessage(f"{view.namespace}/tf_static", now_ns, messages.tf([*statics[:1], static])))
            statics.append(static)
        return sent if self._tf_per_robot else [*sent, RosMessage("/tf_static", now_ns, messages.tf(statics))]

    def _slow(self, now_ns: int) -> list[RosMessage]:
        sent = []
        for view in self._robots.values():
            if view.trail_changed:
                view.trail_changed = False
                sent.append(RosMessage(f"{view.namespace}/trail", now_ns, messages.path_of(now_ns, list(view.trail))))
        if self._map.changed and (grid := self._map.grid()) is not None:
            sent.append(RosMessage("/map", now_ns, messages.occupancy_grid(now_ns, grid)))
        if self._heard("/diagnostics"):
            statuses = [
                messages.diagnosis(f"robot{robot}", view.status, view.error_m(now_ns), self.leader)
                for robot, view in sorted(self._robots.items())
                if view.status is not None
            ]
            sent.append(RosMessage("/diagnostics", now_ns, messages.diagnostics(now_ns, statuses)))
        return sent

    def _view(self, robot: int) -> RobotView | None:
        view = self._robots.get(robot)
        if view is None and len(self._robots) < ROBOTS_MAX:
            view = self._robots[robot] = RobotView(robot, tf_per_robot=self._tf_per_robot)
        return view

    def _every(self, what: str, period_ns: int, now_ns: int) -> bool:
        """Return True once per period; a pause is not made up for."""
        due = self._due.get(what)
        if due is not None and now_ns < due:
            return False
        self._due[what] = now_ns + period_ns if due is None or now_ns > due + period_ns else due + period_ns
        return True
