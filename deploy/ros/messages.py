"""Builders of ROS messages from values of the fleet: units as in ROS (m, rad, s), times in UNIX nanoseconds. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import cos, sin
from typing import Any

import numpy as np

from lfa.deploy.ros.types import kind
from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.messages.robot import LaserScan
from lfa.protocol.messages.team import Level, Status

NS = 1_000_000_000
UNKNOWN_VARIANCE = 1e6
"""Variance of height, roll and pitch: a planar robot does not measure them."""
DRIFT_SHARE = 0.01
"""Standard deviation of wheel odometry as a share of the travelled distance [m/m], and of its yaw [rad/m]."""
LEAST_VARIANCE = 1e-4
TWIST_VARIANCE = 1e-3
LEVELS = {Level.OK: 0, Level.WARN: 1, Level.ERROR: 2, Level.STALE: 3}
LOG_LEVELS = {"debug": 10, "info": 20, "warn": 30, "error": 40}


def time_of(stamp_ns: int) -> Any:
    return kind("builtin_interfaces/msg/Time")(sec=stamp_ns // NS, nanosec=stamp_ns % NS)


def header(stamp_ns: int, frame: str) -> Any:
    return kind("std_msgs/msg/Header")(stamp=time_of(stamp_ns), frame_id=frame)


def point(x: float, y: float, z: float = 0.0) -> Any:
    return kind("geometry_msgs/msg/Point")(x=x, y=y, z=z)


def vector(x: float, y: float, z: float = 0.0) -> Any:
    return kind("geometry_msgs/msg/Vector3")(x=x, y=y, z=z)


def quaternion(yaw: float) -> Any:
    return kind("geometry_msgs/msg/Quaternion")(x=0.0, y=0.0, z=sin(0.5 * yaw), w=cos(0.5 * yaw))


def pose(at: Pose2D) -> Any:
    return kind("geometry_msgs/msg/Pose")(position=point(at.x, at.y), orientation=quaternion(at.theta))


def pose_stamped(stamp_ns: int, at: Pose2D) -> Any:
    return kind("geometry_msgs/msg/PoseStamped")(header=header(stamp_ns, "map"), pose=pose(at))


def twist(of: Twist) -> Any:
    return kind("geometry_msgs/msg/Twist")(linear=vector(of.linear_x, 0.0), angular=vector(0.0, 0.0, of.angular_z))


def twist_stamped(stamp_ns: int, of: Twist, frame: str) -> Any:
    return kind("geometry_msgs/msg/TwistStamped")(header=header(stamp_ns, frame), twist=twist(of))


def odometry(stamp_ns: int, at: Pose2D, of: Twist, odometer_m: float, odom: str, base: str) -> Any:
    """Return nav_msgs/Odometry: pose in `odom`, twist in `base`, covariances of a planar robot that drifts."""
    drift = LEAST_VARIANCE + (DRIFT_SHARE * odometer_m) ** 2
    of_pose = (drift, drift, UNKNOWN_VARIANCE, UNKNOWN_VARIANCE, UNKNOWN_VARIANCE, drift)
    of_twist = (TWIST_VARIANCE, TWIST_VARIANCE, UNKNOWN_VARIANCE, UNKNOWN_VARIANCE, UNKNOWN_VARIANCE, TWIST_VARIANCE)
    return kind("nav_msgs/msg/Odometry")(
        header=header(stamp_ns, odom),
        child_frame_id=base,
        pose=kind("geometry_msgs/msg/PoseWithCovariance")(pose=pose(at), covariance=_diagonal(of_pose)),
        twist=kind("geometry_msgs/msg/TwistWithCovariance")(twist=twist(of), covariance=_diagonal(of_twist)),
    )


def laser_scan(stamp_ns: int, scan: LaserScan, frame: str) -> Any:
    """Return sensor_msgs/LaserScan; +inf, -inf and nan keep their meaning (REP-117)."""
    return kind("sensor_msgs/msg/LaserScan")(
        header=header(stamp_ns, frame),
        angle_min=scan.angle_min,
        angle_max=scan.angle_min + scan.angle_increment * max(0, len(scan.ranges_m) - 1),
        angle_increment=scan.angle_increment,
        time_increment=0.0,
        scan_time=0.1,
        range_min=scan.range_min_m,
        range_max=scan.range_max_m,
        ranges=np.array(scan.ranges_m, dtype=np.float32),
        intensities=np.empty(0, dtype=np.float32),
    )


def transform(stamp_ns: int, parent: str, child: str, at: Pose2D) -> Any:
    return kind("geometry_msgs/msg/TransformStamped")(
        header=header(stamp_ns, parent),
        child_frame_id=child,
        transform=kind("geometry_msgs/msg/Transform")(translation=vector(at.x, at.y), rotation=quaternion(at.theta)),
    )


def tf(transforms: list[Any]) -> Any:
    return kind("tf2_msgs/msg/TFMessage")(transforms=transforms)


def path(stamp_ns: int, poses: Iterable[Pose2D]) -> Any:
    """Return nav_msgs/Path in `map` of poses that are meant for now."""
    return path_of(stamp_ns, [pose_stamped(stamp_ns, one) for one in poses])


def path_of(stamp_ns: int, poses: list[Any]) -> Any:
    """Return nav_msgs/Path in `map` of geometry_msgs/PoseStamped, each with a stamp of its own."""
    return kind("nav_msgs/msg/Path")(header=header(stamp_ns, "map"), poses=poses)


def occupancy_grid(stamp_ns: int, cell_m: float, corner: tuple[float, float], cells: Any) -> Any:
    """Return nav_msgs/OccupancyGrid of int8 `cells`, row by row from the lower left `corner` [m] in `map`."""
    rows, columns = cells.shape
    return kind("nav_msgs/msg/OccupancyGrid")(
        header=header(stamp_ns, "map"),
        info=kind("nav_msgs/msg/MapMetaData")(
            map_load_time=time_of(stamp_ns),
            resolution=cell_m,
            width=columns,
            height=rows,
            origin=pose(Pose2D(*corner)),
        ),
        data=cells.reshape(-1),
    )


def clock(stamp_ns: int) -> Any:
    return kind("rosgraph_msgs/msg/Clock")(clock=time_of(stamp_ns))


def text(words: str) -> Any:
    return kind("std_msgs/msg/String")(data=words)


def number(value: int) -> Any:
    return kind("std_msgs/msg/Int32")(data=value)


def log(stamp_ns: int, level: str, name: str, words: str) -> Any:
    return kind("rcl_interfaces/msg/Log")(
        stamp=time_of(stamp_ns), level=LOG_LEVELS[level], name=name, msg=words, file="", function="", line=0
    )


def diagnostics(stamp_ns: int, statuses: Sequence[Any]) -> Any:
    return kind("diagnostic_msgs/msg/DiagnosticArray")(header=header(stamp_ns, ""), status=list(statuses))


def diagnostic_status(robot: str, status: Status, error_m: float | None) -> Any:
    """Return one robot's diagnostics: its level and sentence, its role and term, its error and all its counters."""
    facts = {"role": str(status.role), "term": str(status.term.n)}
    if error_m is not None:
        facts["error_m"] = f"{error_m:.4f}"
    facts |= {name: f"{value:g}" for name, value in status.counters.items()}
    return kind("diagnostic_msgs/msg/DiagnosticStatus")(
        level=LEVELS[status.level],
        name=f"lfa: {robot}",
        message=status.text,
        hardware_id=robot,
        values=[kind("diagnostic_msgs/msg/KeyValue")(key=name, value=value) for name, value in facts.items()],
    )


def robot_description(base: str, radius_m: float) -> str:
    """Return a URDF of a round robot with a mark at its front."""
    front = f'<origin xyz="{0.8 * radius_m:.3f} 0 0.11"/><geometry><sphere radius="{0.2 * radius_m:.3f}"/></geometry>'
    return f"""<?xml version="1.0"?>
<robot name="lfa">
  <link name="{base}">
    <visual>
      <origin xyz="0 0 0.05"/><geometry><cylinder radius="{radius_m:.3f}" length="0.1"/></geometry>
    </visual>
    <visual>{front}</visual>
  </link>
</robot>
"""


def _diagonal(values: Sequence[float]) -> Any:
    covariance = np.zeros(36)
    covariance[::7] = values
    return covariance
