"""What the mapping remembers of one robot. Pure."""

from __future__ import annotations

from collections import deque
from math import hypot

from lfa.deploy.ros import messages
from lfa.deploy.ros.cdr import NS
from lfa.protocol.geometry import Pose2D, along_arc, compose, inverse
from lfa.protocol.messages.robot import CmdVel, Sensors
from lfa.protocol.messages.team import PoseStamped, Status, Tracking

STALE_NS = NS
"""Age [ns] above which a robot's claim to lead, its slot, or a reported obstacle counts no more."""
MOVES_NS = NS // 10
"""Age [ns] of odometry above which no transform waits for the robot's next."""
EXTRAPOLATED_S_MAX = 0.2
"""Largest time [s] between a pose and the odometry that it is compared with."""
ODOMETRY_KEPT = 10
"""Number of odometry messages kept: 0.2 s."""
TRAIL_STEP_M, TRAIL_POINTS_MAX = 0.1, 500


class RobotView:
    """What the mapping remembers of one robot."""

    def __init__(self, robot: int, *, tf_per_robot: bool) -> None:
        self.namespace = f"/robot{robot}"
        prefix = "" if tf_per_robot else f"robot{robot}/"
        self.odom, self.base, self.laser = f"{prefix}odom", f"{prefix}base_link", f"{prefix}base_scan"
        self.sensors: tuple[int, Sensors] | None = None
        self._odometry: deque[tuple[int, Sensors]] = deque(maxlen=ODOMETRY_KEPT)
        """The last odometry: a pose tells of a time that may lie before the newest."""
        self.pose: tuple[int, PoseStamped] | None = None
        self.tracking: tuple[int, Tracking] | None = None
        self.status: Status | None = None
        self.map_odom: Pose2D | None = None
        self.trail: deque[bytes] = deque(maxlen=TRAIL_POINTS_MAX)
        """The way driven as parts of a path, each built and stamped when the robot was there."""
        self._trail_end: Pose2D | None = None
        self.trail_changed = False
        self.tf_due = False

    def place(self, stamp_ns: int, message: PoseStamped) -> Pose2D:
        """Take a pose in `map`; return it. Updates the trail, and `odom` in `map` by the odometry of the same time."""
        at = Pose2D(message.x, message.y, message.theta)
        self.pose = (stamp_ns, message)
        last = self._trail_end
        if last is None or hypot(at.x - last.x, at.y - last.y) >= TRAIL_STEP_M:
            self._trail_end = at
            self.trail.append(messages.waypoint(stamp_ns, at))
            self.trail_changed = True
        if self._odometry:
            nearest_ns, sensors = min(self._odometry, key=lambda known: abs(stamp_ns - known[0]))
            since_s = (stamp_ns - nearest_ns) / NS
            if abs(since_s) <= EXTRAPOLATED_S_MAX:
                self.map_odom = compose(at, inverse(along_arc(sensors.pose_odom, sensors.twist, since_s)))
        return at

    def move(self, stamp_ns: int, sensors: Sensors) -> None:
        """Take odometry; its transform is due."""
        self.sensors, self.tf_due = (stamp_ns, sensors), True
        self._odometry.append(self.sensors)

    def moves(self, now_ns: int) -> bool:
        """Return True while odometry comes."""
        return self.sensors is not None and now_ns - self.sensors[0] < MOVES_NS

    def refuses(self, command: CmdVel) -> bool:
        """Return True if the robot's gateway, by its last report, refuses the command (E11, E12, E14)."""
        if self.sensors is None:
            return False
        gateway = self.sensors[1]
        barred = command.as_leader and gateway.latched and command.term <= gateway.term_max
        return barred or command.term < gateway.term_max

    def error_m(self, now_ns: int) -> float | None:
        """Return the distance [m] from its slot, by its own estimate; None unless it follows."""
        if self.tracking is None or now_ns - self.tracking[0] > STALE_NS:
            return None
        return float(self.tracking[1].error_m)
