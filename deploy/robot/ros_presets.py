"""Names of topics of ROS robots, by make: presets, and a file for one's own. Relative names are in its namespace."""

from __future__ import annotations

from pathlib import Path

import msgspec
from msgspec import Struct

from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import read_text


class RosPreset(Struct, frozen=True, forbid_unknown_fields=True):
    """Topics of one make of robot. A name with a leading `/` is global; None: the robot has no such topic."""

    odom: str = "odom"
    """nav_msgs/Odometry, best effort or reliable."""
    scan: str | None = "scan"
    """sensor_msgs/LaserScan."""
    cmd_vel: str = "cmd_vel"
    """Twist or TwistStamped: which one is found from the ROS graph."""
    pose: str | None = "amcl_pose"
    """geometry_msgs/PoseWithCovarianceStamped in `map`, used while nobody publishes `map` -> `odom` on /tf."""
    laser: tuple[float, float, float] | None = None
    """x, y [m] and yaw [rad] of the scanner in the base frame; None: from /tf_static."""


PRESETS: dict[str, RosPreset] = {
    # turtlebot3_node/src/odometry.cpp and param/burger.yaml (main): odom, TwistStamped; Twist in param/humble.
    "turtlebot3": RosPreset(),
    # turtlebot4_bringup/launch/robot.launch.py: the republished topics of the Create 3 base, and the rplidar, which
    # turtlebot4_description mounts at a yaw of +pi/2: its mount comes from /tf_static.
    "turtlebot4": RosPreset(),
    # iRobot Create 3, its own topics by way of zenoh-bridge-ros2dds or a republisher; it has no scanner.
    "create3": RosPreset(scan=None),
    # docs.clearpathrobotics.com, API of the platform: namespaces such as /a200_0000.
    "clearpath": RosPreset(odom="platform/odom", scan="sensors/lidar2d_0/scan"),
    # nav2_bringup and nav2_amcl/src/amcl_node.cpp: amcl_pose is latched and comes on motion only.
    "nav2": RosPreset(),
}


LASER_M_MAX = 100.0
"""Greatest offset [m], and angle [rad], of a scanner from its base."""


def load_preset(name: str) -> RosPreset:
    """Return the preset `name`, or that of a TOML file. Raises Refused."""
    if name in PRESETS:
        return PRESETS[name]
    if not name.endswith(".toml"):
        raise Refused(f"--robot {name}: must be one of {', '.join(PRESETS)}, or a file NAME.toml with such keys")
    try:
        preset = msgspec.toml.decode(read_text(Path(name)), type=RosPreset)
        if preset.laser is not None and not all(abs(value) <= LASER_M_MAX for value in preset.laser):  # also nan
            raise ValueError(f"laser = {list(preset.laser)}, each at most {LASER_M_MAX:g}")
        return preset
    except OSError as error:
        raise Refused(
            f"--robot {name}: {error.strerror}: must be a file with keys such as odom, scan, cmd_vel"
        ) from None
    except (msgspec.DecodeError, ValueError, RecursionError) as error:  # DamagedFile is a ValueError
        keys = ", ".join(RosPreset.__struct_fields__)
        raise Refused(f"--robot {name}: {' '.join(str(error).split())}: must be TOML with keys {keys}") from None


def full_name(namespace: str, name: str) -> str:
    """Return a topic's full name: `/robot3/odom` for `odom` in `/robot3`."""
    return name if name.startswith("/") else f"{namespace}/{name}"
