"""Messages of other ROS nodes, built by `rosbags`."""

from __future__ import annotations

from collections.abc import Iterable
from math import cos, sin
from typing import Any

import numpy as np

from lfa.deploy.ros.types import kind
from lfa.protocol.geometry import Pose2D


def header(stamp_ns: int, frame: str) -> Any:
    """Return std_msgs/Header."""
    time = kind("builtin_interfaces/msg/Time")(*divmod(stamp_ns, 10**9))
    return kind("std_msgs/msg/Header")(stamp=time, frame_id=frame)


def pose_with_covariance(stamp_ns: int, at: Pose2D, covariance: Iterable[float]) -> Any:
    """Return geometry_msgs/PoseWithCovarianceStamped in `map`; `covariance`: 36 numbers, row by row."""
    place = kind("geometry_msgs/msg/Point")(at.x, at.y, 0.0)
    turn = kind("geometry_msgs/msg/Quaternion")(0.0, 0.0, sin(0.5 * at.theta), cos(0.5 * at.theta))
    pose = kind("geometry_msgs/msg/Pose")(place, turn)
    uncertain = kind("geometry_msgs/msg/PoseWithCovariance")(pose, np.array([*covariance], dtype=np.float64))
    return kind("geometry_msgs/msg/PoseWithCovarianceStamped")(header(stamp_ns, "map"), uncertain)
