"""Builders of ROS messages, encoded, from values of the fleet: units as in ROS (m, rad, s), times in UNIX ns. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from math import cos, sin
from typing import NamedTuple

from lfa.deploy.ros.cdr import CDR_LITTLE_ENDIAN, CdrMessage, CdrWriter, Form, floats
from lfa.deploy.ros.explored import MapCells
from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.messages.robot import LaserScan
from lfa.protocol.messages.team import Level, Status

UNKNOWN_VARIANCE = 1e6
"""Variance of height, roll and pitch: a planar robot does not measure them."""
DRIFT_SHARE = 0.01
"""Standard deviation of wheel odometry as a share of the travelled distance [m/m], and of its yaw [rad/m]."""
LEAST_VARIANCE = 1e-4
TWIST_VARIANCE = 1e-3
SCAN_S = 0.1
"""Time [s] from one scan to the next."""
LEVELS = {Level.OK: 0, Level.WARN: 1, Level.ERROR: 2, Level.STALE: 3}
LOG_LEVELS = {"debug": 10, "info": 20, "warn": 30, "error": 40}
_FORMS_MAX = 2048
"""Number of layouts kept: of eight messages and transforms for each of 256 robots."""

# Numbers of a message as `struct` packs them; `x` is a zero byte.
_VECTOR_X, _VECTOR_Z, _PLACE, _TURN = "d16x", "16xd", "2d8x", "16x2d"
_COVARIANCE = "48x".join("d" * 6)
_POSE = _PLACE + _TURN
_TWIST = _VECTOR_X + _VECTOR_Z
_UNKNOWN = (UNKNOWN_VARIANCE, UNKNOWN_VARIANCE, UNKNOWN_VARIANCE)
_TWIST_COVARIANCE = (TWIST_VARIANCE, TWIST_VARIANCE, *_UNKNOWN, TWIST_VARIANCE)


@lru_cache(maxsize=_FORMS_MAX)
def _form(numbers: str, *strings: str, align: int = 8, at: int = 0) -> Form:
    return Form(strings, numbers, align=align, at=at)


def placed(at: Pose2D) -> tuple[float, float, float, float]:
    """Return x, y [m] of a pose, and z, w of its rotation as a quaternion: what is not zero of it in ROS."""
    return at.x, at.y, sin(0.5 * at.theta), cos(0.5 * at.theta)


def pose_stamped(stamp_ns: int, at: Pose2D) -> CdrMessage:
    """Return geometry_msgs/PoseStamped in `map`."""
    return CdrMessage("geometry_msgs/msg/PoseStamped", CDR_LITTLE_ENDIAN + waypoint(stamp_ns, at))


def twist(of: Twist) -> CdrMessage:
    numbers = (of.linear_x, 0.0, 0.0, 0.0, 0.0, of.angular_z)
    return CdrWriter().float64(*numbers).message("geometry_msgs/msg/Twist")


def twist_stamped(stamp_ns: int, of: Twist, frame: str) -> CdrMessage:
    packed = _form(_TWIST, frame).pack(stamp_ns, of.linear_x, of.angular_z)
    return CdrMessage("geometry_msgs/msg/TwistStamped", CDR_LITTLE_ENDIAN + packed)


def odometry(stamp_ns: int, at: Pose2D, of: Twist, odometer_m: float, odom: str, base: str) -> CdrMessage:
    """Return nav_msgs/Odometry: pose in `odom`, twist in `base`, covariances of a planar robot that drifts."""
    drift = LEAST_VARIANCE + (DRIFT_SHARE * odometer_m) ** 2
    form = _form(_POSE + _COVARIANCE + _TWIST + _COVARIANCE, odom, base)
    of_twist = of.linear_x, of.angular_z
    packed = form.pack(stamp_ns, *placed(at), drift, drift, *_UNKNOWN, drift, *of_twist, *_TWIST_COVARIANCE)
    return CdrMessage("nav_msgs/msg/Odometry", CDR_LITTLE_ENDIAN + packed)


def laser_scan(stamp_ns: int, scan: LaserScan, frame: str) -> CdrMessage:
    """Return sensor_msgs/LaserScan; +inf, -inf and nan keep their meaning (REP-117)."""
    count = len(scan.ranges_m)
    angle_max = scan.angle_min + scan.angle_increment * max(0, count - 1)
    span = scan.angle_min, angle_max, scan.angle_increment, 0.0, SCAN_S, scan.range_min_m, scan.range_max_m
    head = _form("7fI", frame, align=4).pack(stamp_ns, *span, count)
    no_intensities = bytes(4)
    packed = head + floats(scan.ranges_m) + no_intensities
    return CdrMessage("sensor_msgs/msg/LaserScan", CDR_LITTLE_ENDIAN + packed)


class Transform(NamedTuple):
    """Pose `at` of frame `child` in frame `parent`."""

    stamp_ns: int
    parent: str
    child: str
    at: Pose2D


def tf(transforms: Sequence[Transform]) -> CdrMessage:
    parts = [CDR_LITTLE_ENDIAN, len(transforms).to_bytes(4, "little")]
    at = 4  # behind the count; each transform ends at a multiple of eight
    for one in transforms:
        parts.append(_form(_POSE, one.parent, one.child, at=at).pack(one.stamp_ns, *placed(one.at)))
        at = 0
    return CdrMessage("tf2_msgs/msg/TFMessage", b"".join(parts))


def waypoint(stamp_ns: int, at: Pose2D) -> bytes:
    """Return one pose in `map` with a stamp of its own, as a part of a path."""
    return _form(_POSE, "map").pack(stamp_ns, *placed(at))


def path(stamp_ns: int, poses: Iterable[Pose2D]) -> CdrMessage:
    """Return nav_msgs/Path in `map` of poses that are meant for now."""
    return path_of(stamp_ns, [waypoint(stamp_ns, one) for one in poses])


def path_of(stamp_ns: int, waypoints: Sequence[bytes]) -> CdrMessage:
    """Return nav_msgs/Path in `map` of the parts that `waypoint` returned."""
    out = CdrWriter().time(stamp_ns).string("map").int32(len(waypoints))
    for one in waypoints[:1]:  # behind the count, its numbers lie four bytes later than those of all others
        stamp_and_frame = len(one) - 7 * 8
        out.octets(one[:stamp_and_frame]).align(8).octets(one[stamp_and_frame:])
    return out.octets(b"".join(waypoints[1:])).message("nav_msgs/msg/Path")


def occupancy_grid(stamp_ns: int, grid: MapCells) -> CdrMessage:
    """Return nav_msgs/OccupancyGrid in `map`."""
    out = CdrWriter().time(stamp_ns).string("map").time(stamp_ns).float32(grid.cell_m).int32(grid.columns, grid.rows)
    out.float64(*grid.corner, 0.0, 0.0, 0.0, 0.0, 1.0).int32(len(grid.cells)).octets(grid.cells)
    return out.message("nav_msgs/msg/OccupancyGrid")


def clock(stamp_ns: int) -> CdrMessage:
    return CdrWriter().time(stamp_ns).message("rosgraph_msgs/msg/Clock")


def text(words: str) -> CdrMessage:
    return CdrWriter().string(words).message("std_msgs/msg/String")


def shown_id(robot: int) -> int:
    """Return a robot's id as ROS messages carry it: its last 31 bits."""
    return robot % 2**31


def number(robot: int) -> CdrMessage:
    """Return std_msgs/Int32 of a robot's id; 0 for none."""
    return CdrWriter().int32(shown_id(robot)).message("std_msgs/msg/Int32")


def log(stamp_ns: int, level: str, name: str, words: str) -> CdrMessage:
    file, function, line = "", "", 0
    out = CdrWriter().time(stamp_ns).int8(LOG_LEVELS[level]).string(name, words, file, function).int32(line)
    return out.message("rcl_interfaces/msg/Log")


def answer_of_service(success: bool, words: str) -> CdrMessage:
    """Return std_srvs/Trigger's response, which is SetBool's as well."""
    return CdrWriter().int8(success).string(words).message("std_srvs/msg/Trigger_Response")


class RobotDiagnostics(NamedTuple):
    """Diagnostics of one robot."""

    robot: str
    level: int
    words: str
    facts: dict[str, str]


def diagnosis(robot: str, status: Status, error_m: float | None, leader: int) -> RobotDiagnostics:
    """Return one robot's diagnostics: level and sentence, role, term, its leader (0: none), error, all its counters."""
    facts = {"role": str(status.role), "term": str(status.term.n), "leader": str(leader)}
    if error_m is not None:
        facts["error_m"] = f"{error_m:.4f}"
    facts |= {name: f"{value:g}" for name, value in status.counters.items()}
    return RobotDiagnostics(robot, LEVELS[status.level], status.text, facts)


def diagnostics(stamp_ns: int, robots: Sequence[RobotDiagnostics]) -> CdrMessage:
    no_frame = ""
    out = CdrWriter().time(stamp_ns).string(no_frame).int32(len(robots))
    for one in robots:
        out.int8(one.level).string(f"lfa: {one.robot}", one.words, one.robot).int32(len(one.facts))
        for name, value in one.facts.items():
            out.string(name, value)
    return out.message("diagnostic_msgs/msg/DiagnosticArray")


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
