"""Plausibility bounds for poses and twists received from other robots, and for odometry over time."""

from __future__ import annotations

from lfa.protocol.geometry import Pose2D, Twist, along_arc, between, distance, wrap

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
FROZEN_M = 0.1
"""Way [m], or turn by `TURN_M_PER_RAD`, by the said speeds after which a pose must have moved along: within `FROZEN_S`
of driving at 0.2 m/s. Less counts centimetres of an encoder, or what jitters about one place."""
FROZEN_SHARE = 0.2
"""Least share of the said way that a pose has moved."""
REST_MPS, REST_RADPS = 0.05, 0.1
"""Speeds [m/s, rad/s] below which odometry says that the robot rests."""
TURN_M_PER_RAD = 0.3
"""Way [m] that a turn of one radian counts as."""
GAP_S_MAX = 0.5
"""Time [s] between two messages for which the speed of the later one is taken to have held."""


class FrozenOdometry:
    """Whether one robot's odometry stays where it is while it says that it moves, as a driver's does that has lost its
    wheels.
    """

    def __init__(self) -> None:
        self._from: Pose2D | None = None
        """Pose from which the ways are counted."""
        self._said = Pose2D()
        """Motion since then by the said speeds."""
        self._from_at = self._stamp = 0.0
        self.frozen = False

    def update(self, pose: Pose2D, twist: Twist, stamp: float) -> bool:
        """Update with odometry of `stamp` [s]; return `frozen`."""
        if self._from is None:
            self._from, self._from_at, self._stamp = pose, stamp, stamp
            return False
        dt_s, self._stamp = min(stamp - self._stamp, GAP_S_MAX), stamp
        self._said = along_arc(self._said, twist, dt_s)
        said_m, moved_m = _way_m(Pose2D(), self._said), _way_m(self._from, pose)
        if said_m >= FROZEN_M and stamp - self._from_at > FROZEN_S:
            self.frozen = moved_m < FROZEN_SHARE * said_m and not _rests(twist)  # a gyroscope at rest drifts
        elif not self.frozen or (not _rests(twist) and moved_m < FROZEN_SHARE * FROZEN_M):
            return self.frozen
        else:
            self.frozen = False
        self._from, self._said, self._from_at = pose, Pose2D(), stamp
        return self.frozen


HUNG_M, HUNG_SHARE = 0.3, 0.3
"""Way [m] by the wheels of which the fixes must have made that share: what they say of one place, noise and all, is an
old pose that is said again. So is what they say of a robot whose wheels slip, which is no robot to drive either."""

AGREES_SHARE = 0.5
"""Share of such a way by which fixes and wheels differ at most where the fixes only err more than they say."""


class HungLocalization:
    """Whether one robot's fixes stay where they are under fresh stamps while its wheels drive on."""

    def __init__(self) -> None:
        self._from: tuple[Pose2D, Pose2D] | None = None
        """Fix, and pose in `odom`, from which the ways are counted."""
        self.agrees = False
        """True if the fixes went along with the wheels on the last way of `HUNG_M`."""

    def update(self, pose_map: Pose2D, pose_odom: Pose2D) -> bool:
        """Update with a fix, and the odometry of the moment; return True if the localization hangs."""
        if self._from is not None:
            way_m, moved_m = distance(self._from[1], pose_odom), distance(self._from[0], pose_map)
            if way_m < HUNG_M:
                return False
            fixed, driven = between(self._from[0], pose_map), between(self._from[1], pose_odom)
            self.agrees = distance(fixed, driven) < AGREES_SHARE * way_m
            if moved_m < HUNG_SHARE * way_m:
                return True
        self._from = pose_map, pose_odom
        return False


def _rests(twist: Twist) -> bool:
    return abs(twist.linear_x) < REST_MPS and abs(twist.angular_z) < REST_RADPS


def _way_m(start: Pose2D, end: Pose2D) -> float:
    return distance(start, end) + TURN_M_PER_RAD * abs(wrap(end.theta - start.theta))
