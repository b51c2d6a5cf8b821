"""Hardware interface of a ROS 2 robot: odometry, scan and pose in, velocity commands out.

Ages count from arrival: the robot's own clock may be wrong. While `odom` is older than `ODOM_S_MAX` nothing is read,
whatever the ROS graph says, and the driver is silent: a token may outlive a frozen robot by a minute.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from math import hypot, inf, isfinite, sqrt
from typing import Any

from lfa.agents.localization.estimator import SIGMA_M_MAX, SIGMA_RAD_MAX
from lfa.agents.localization.plausibility import FrozenOdometry, plausible
from lfa.deploy.robot.base import Reading, Scan
from lfa.deploy.robot.ros_frames import FrameTree
from lfa.deploy.robot.ros_presets import RosPreset, full_name
from lfa.deploy.robot.ros_scan import converted, remarks
from lfa.deploy.ros import messages
from lfa.deploy.ros.quaternions import yaw_of
from lfa.deploy.ros.session import NodeHandle
from lfa.deploy.ros.topics import TF_QOS
from lfa.deploy.ros.wire import LATCHED, SENSOR_DATA
from lfa.protocol.errors import Refused
from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc, compose, inverse

ODOM_S_MAX = 0.2
"""Age [s] of the last odometry above which the robot gives no reading."""
FIX_S = 0.1
"""Period [s] of poses in `map`."""
PLACED_S = 5.0
"""Time [s] without any pose in `map` that is worth a warning."""
TF_S_MAX = 2.0
"""Age [s] above which `map` -> `odom` on /tf counts no more."""
POSE_M_MAX = 1.0
"""Way [m] driven since the last pose of the localisation beyond which it counts no more: twice the way after which slow
ones say the next. A topic's last value outlives the localisation."""
JUMP_M, JUMP_MPS = 0.5, 5.0
"""Motion between two odometry messages that no robot makes: more than JUMP_M [m] and faster than JUMP_MPS [m/s]."""
CLOCK_S_MAX = 0.1
"""Difference [s] between a stamp and its arrival that is worth a warning."""
Warn = Callable[[str, str], None]
"""Prints a warning (its kind, its words) once per kind."""


class RosBase:
    """ROS robot in `namespace`; `node` is this driver's node in the robot's domain."""

    def __init__(
        self, node: NodeHandle, namespace: str, names: RosPreset, *, stamped: bool, start_map: Pose2D | None, warn: Warn
    ) -> None:
        """`start_map`: where the robot stands at its first odometry, if nobody localises it. `warn`: see Warn."""
        self._stamped = stamped
        self._warn = warn
        self._start_map = start_map
        self._wall_ns = time.time_ns
        self._frames = FrameTree()
        self._mount = None if names.laser is None else Pose2D(*names.laser)
        self._odom: tuple[float, Pose2D, Twist] | None = None
        self._odom_frame, self._base_frame = "odom", "base_link"
        self._odometer_m = 0.0
        self._wheels = FrozenOdometry()
        self._map_odom: Pose2D | None = None
        self._posed_at_m: float | None = None
        """Odometer at the localisation's last pose [m]; None before the first."""
        self._sigma = 0.0, 0.0
        """Standard deviations [m, rad] of the localisation's last pose; infinite if that is none."""
        self._from_tf = False
        self._fix_due = 0.0
        self._placed_by: float | None = None
        of_type = "geometry_msgs/msg/TwistStamped" if stamped else "geometry_msgs/msg/Twist"
        self._cmd_vel = node.publisher(full_name(namespace, names.cmd_vel), of_type)
        self._odoms = node.subscription(full_name(namespace, names.odom), "nav_msgs/msg/Odometry", SENSOR_DATA)
        self._scans, self._poses = None, None
        if names.scan is not None:
            self._scans = node.subscription(full_name(namespace, names.scan), "sensor_msgs/msg/LaserScan", SENSOR_DATA)
        if names.pose is not None:
            of_pose = "geometry_msgs/msg/PoseWithCovarianceStamped"
            self._poses = node.subscription(full_name(namespace, names.pose), of_pose, LATCHED)
        places = {"", namespace}
        self._tf = [node.subscription(f"{place}/tf", "tf2_msgs/msg/TFMessage", TF_QOS) for place in places]
        self._tf += [node.subscription(f"{place}/tf_static", "tf2_msgs/msg/TFMessage", LATCHED) for place in places]

    def drive(self, twist: Twist, _now: float) -> None:
        """Publish the command, also when it is zero: the robot may keep its last one."""
        stamp_ns = self._wall_ns()
        stamped = messages.twist_stamped(stamp_ns, twist, self._base_frame) if self._stamped else messages.twist(twist)
        self._cmd_vel.publish(stamped)

    def read(self, now: float) -> Reading | None:
        """Return what the robot measured; None while its odometry is missing or old."""
        for subscription in self._tf:
            for message in subscription.take():
                self._frames.update(message, now)
        for arrived, message in self._odoms.take_timed():
            self._take_odom(message, arrived)
        scan = self._newest_scan()
        self._take_poses()
        if self._odom is None or now - self._odom[0] > ODOM_S_MAX:
            if self._odom is not None:
                self._warn("silent", f"no odometry for {ODOM_S_MAX:g} s: says nothing, drives nothing until it returns")
            return None
        if self._wheels.frozen:
            self._warn("frozen", "odometry says that it moves, and stays the same: says nothing until it moves")
            return None
        arrived, pose, twist = self._odom
        pose_odom = along_arc(pose, twist, now - arrived)
        self._locate(now)
        pose_map = None
        if self._map_odom is not None and now >= self._fix_due and self._is_sure():
            self._fix_due = now + FIX_S
            pose_map = compose(self._map_odom, pose_odom)
        sigma_m, sigma_rad = self._sigma
        return Reading(pose_odom, twist, self._odometer_m, pose_map, scan, sigma_m=sigma_m, sigma_rad=sigma_rad)

    def _take_odom(self, message: Any, arrived: float) -> None:
        place, turn, twist = message.pose.pose.position, message.pose.pose.orientation, message.twist.twist
        yaw, moving = yaw_of(turn), Twist(twist.linear.x, twist.angular.z)
        if yaw is None or not plausible(pose := Pose2D(place.x, place.y, yaw), moving):
            self._warn("odom", "odom has numbers that are not finite or of no robot, or no quaternion: dropped")
            return
        if self._odom is not None:
            step_m = hypot(pose.x - self._odom[1].x, pose.y - self._odom[1].y)
            dt_s = max(1e-3, arrived - self._odom[0])
            if step_m > JUMP_M and step_m > JUMP_MPS * dt_s:
                self._warn(
                    "jump", f"odom jumped by {step_m:.2f} m: must be continuous (REP-105); its map is found anew"
                )
                self._rebase(pose)
            else:
                self._odometer_m += step_m
        self._odom = (arrived, pose, moving)
        self._wheels.update(pose, moving, arrived)
        self._odom_frame, self._base_frame = message.header.frame_id or "odom", message.child_frame_id or "base_link"
        stamp_s = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        off_s = 1e-9 * self._wall_ns() - stamp_s
        if abs(off_s) > CLOCK_S_MAX and stamp_s > 0.0:
            self._warn("clock", f"stamps of odom differ from this clock by {off_s:.2f} s: times of arrival are used")

    def _rebase(self, pose: Pose2D) -> None:
        """Keep the place in `map` when `odom` jumps to `pose`."""
        if self._map_odom is not None and self._odom is not None:
            self._map_odom = compose(compose(self._map_odom, self._odom[1]), inverse(pose))

    def _take_poses(self) -> None:
        """Take the newest pose of the localisation: where `odom` is in `map`, until the next."""
        for message in [] if self._poses is None else self._poses.take()[-1:]:
            place, yaw = message.pose.pose.position, yaw_of(message.pose.pose.orientation)
            if yaw is None or not plausible(Pose2D(place.x, place.y, yaw), STILL):
                self._warn("pose", "the pose in map has numbers that are not finite or of no robot: dropped")
                continue
            self._sigma = _deviations(message.pose.covariance)
            if self._sigma[0] > SIGMA_M_MAX or self._sigma[1] > SIGMA_RAD_MAX:
                bound = f"more than {SIGMA_M_MAX:g} m or {SIGMA_RAD_MAX:g} rad"
                self._warn("sigma", f"the pose in map is uncertain by {bound}, or has no covariance: it is no pose")
            elif self._odom is not None:
                self._posed_at_m = self._odometer_m
                self._map_odom, self._from_tf = compose(Pose2D(place.x, place.y, yaw), inverse(self._odom[1])), False

    def _is_sure(self) -> bool:
        """Return True if the place in `map` is no guess: of a localisation that is certain and still says poses.

        The agent drives on by its wheels for a while, then slows, and has no pose.
        """
        if self._sigma[0] > SIGMA_M_MAX or self._sigma[1] > SIGMA_RAD_MAX:
            return False
        if self._from_tf or self._posed_at_m is None or self._odometer_m - self._posed_at_m <= POSE_M_MAX:
            return True
        self._warn("poses", f"no pose of the localisation for {POSE_M_MAX:g} m: no pose in map until then")
        return False

    def _locate(self, now: float) -> None:
        """Prefer `map` -> `odom` from /tf, which is smooth; without any localisation begin at `start_map`."""
        assert self._odom is not None
        link = self._frames.direct("map", self._odom_frame)
        if link is not None and now - link.heard_at <= TF_S_MAX:
            self._map_odom, self._from_tf = link.at, True
        elif self._from_tf:
            self._map_odom, self._from_tf = None, False
            self._warn(
                "tf", f"map -> {self._odom_frame} is older than {TF_S_MAX:g} s on /tf: no pose in map until then"
            )
        elif self._map_odom is None and self._start_map is not None:
            self._map_odom = compose(self._start_map, inverse(self._odom[1]))
        if self._placed_by is None or self._map_odom is not None:
            self._placed_by = now + PLACED_S
        elif now > self._placed_by:
            self._warn("map", "no pose in map: neither map -> odom on /tf nor a localisation's pose, and no --at")

    def _newest_scan(self) -> Scan | None:
        newest = [] if self._scans is None else self._scans.take()[-1:]
        for message in newest:
            laser = message.header.frame_id
            mount = self._mount or self._frames.between(self._base_frame, laser)
            if mount is None:
                words = f"no /tf_static leads from {self._base_frame} to {laser}: its scans are dropped, say --laser"
                self._warn("mount", f"{words} X,Y,YAW")
                return None
            if self._mount is None and self._frames.is_tilted(laser, self._base_frame):
                self._warn("tilt", f"{laser} is not level: its scans are dropped, say --laser X,Y,YAW if they are flat")
                return None
            try:
                scan = converted(message, mount)
            except Refused as refused:
                self._warn("scan", f"a scan is dropped: {refused}")
                return None
            for kind, words in remarks(message).items():
                self._warn(kind, words)
            return scan
        return None


def _deviations(covariance: Sequence[float]) -> tuple[float, float]:
    """Return the standard deviations [m, rad] of position, in its worse axis, and yaw; infinite for no covariance.

    `covariance` is that of x, y, z, roll, pitch and yaw, row by row. Zeros are those of a sender that knows none.
    """
    variances = [float(covariance[at]) for at in (0, 7, 35)]
    if not all(isfinite(one) and one >= 0.0 for one in variances):
        return inf, inf
    return sqrt(max(variances[:2])), sqrt(variances[2])
