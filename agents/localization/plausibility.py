"""Plausibility bounds for poses and twists received from other robots, and for odometry over time."""

from __future__ import annotations

from lfa.protocol.geometry import Pose2D, Twist

POSITION_MAX_M = 1e6
SPEED_MAX = 50.0
"""Maximum plausible speed [m/s, rad/s]: no robot of the fleet is faster."""


def plausible(pose: Pose2D, twist: Twist) -> bool:
    """Return whether a robot of the fleet can have this pose and twist; False if not finite (nan compares false)."""
    return (
        -POSITION_MAX_M < pose.x < POSITION_MAX_M
        and -POSITION_MAX_M < pose.y < POSITION_MAX_M
        and -POSITION_MAX_M < pose.theta < POSITION_MAX_M
        and -SPEED_MAX < twist.linear_x < SPEED_MAX
        and -SPEED_MAX < twist.angular_z < SPEED_MAX
    )


FROZEN_S = 0.5
"""Time [s] after which odometry that says it moves, and has not moved, is an old one that is said again."""
MOVES_MPS, MOVES_RADPS = 0.05, 0.1
"""Speeds [m/s, rad/s] beyond which odometry must have moved within `FROZEN_S`: any encoder counts centimetres."""


class FrozenOdometry:
    """Whether one robot's odometry repeats itself under fresh stamps, as a driver does that has lost its wheels."""

    def __init__(self) -> None:
        self._pose: Pose2D | None = None
        self._moved_at = 0.0
        self.frozen = False

    def update(self, pose: Pose2D, twist: Twist, stamp: float) -> bool:
        """Update with odometry of `stamp` [s]; return `frozen`."""
        rests = abs(twist.linear_x) < MOVES_MPS and abs(twist.angular_z) < MOVES_RADPS
        if rests or pose != self._pose:
            self._pose, self._moved_at = pose, stamp
        self.frozen = stamp - self._moved_at > FROZEN_S
        return self.frozen
