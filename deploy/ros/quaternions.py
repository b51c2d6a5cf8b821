"""Rotations of ROS messages, which are quaternions, for robots that turn in the plane. Pure."""

from __future__ import annotations

from math import atan2, isfinite
from typing import Any

TILT_MAX = 0.05
"""Largest sine of the angle between a frame's z axis and the vertical that still counts as level."""


def yaw_of(turn: Any) -> float | None:
    """Return the yaw [rad] of a quaternion; None if it is none."""
    parts = (turn.x, turn.y, turn.z, turn.w)
    if not all(map(isfinite, parts)) or not 0.5 < sum(part * part for part in parts) < 2.0:
        return None
    return atan2(2.0 * (turn.w * turn.z + turn.x * turn.y), 1.0 - 2.0 * (turn.y * turn.y + turn.z * turn.z))


def is_tilted(turn: Any) -> bool:
    """Return True if the rotated z axis does not point up: rolled, pitched or upside down."""
    up = 1.0 - 2.0 * float(turn.x * turn.x + turn.y * turn.y)
    return up < 0.0 or 1.0 - up * up > TILT_MAX * TILT_MAX
