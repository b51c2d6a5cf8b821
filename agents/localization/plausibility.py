"""Plausibility bounds for poses and twists received from other robots."""

from __future__ import annotations

from lfa.protocol.geometry import Pose2D, Twist

POSITION_MAX_M = 1e6
SPEED_MAX = 50.0
"""Maximum plausible speed [m/s, rad/s]: no robot of the fleet is faster."""


def plausible(pose: Pose2D, twist: Twist) -> bool:
    """Return whether a robot of the fleet can have this pose and twist; False if not finite (nan compares false)."""
    return (
        abs(pose.x) < POSITION_MAX_M
        and abs(pose.y) < POSITION_MAX_M
        and abs(pose.theta) < POSITION_MAX_M
        and abs(twist.linear_x) < SPEED_MAX
        and abs(twist.angular_z) < SPEED_MAX
    )
