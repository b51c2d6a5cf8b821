"""Hardware interface of a driver, and a simulated motor that implements it. Put your own class beside it.

For a TurtleBot, `drive` writes the wheel speeds, and `read` polls wheels, localisation, scanner and bumper. Neither may
block: both are called 50 times a second from one thread. SI units and radians, frames as in REP-105.
"""

from __future__ import annotations

from math import inf
from typing import Protocol

from msgspec import Struct

from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc, compose
from lfa.protocol.mission import Limits


class Scan(Struct, frozen=True):
    """One scan, as `lfa.protocol.messages.robot.LaserScan`: +inf beyond the range, nan for a bad beam (REP-117)."""

    angle_min: float
    angle_increment: float
    range_min_m: float
    range_max_m: float
    ranges_m: tuple[float, ...]


class Reading(Struct, frozen=True):
    """Measurements of the hardware at one moment; None: nothing new since the last reading."""

    pose_odom: Pose2D
    """Pose from the wheels alone: continuous, and drifting."""
    twist: Twist
    odometer_m: float
    """Travelled distance [m], forwards and backwards: never decreases."""
    pose_map: Pose2D | None = None
    """Pose from localisation: does not drift. Ten times a second is enough."""
    scan: Scan | None = None
    contact: float | None = None
    """Bearing [rad] in `base_link` of a bumper contact."""
    own: dict[str, dict[str, float]] = {}
    """New measurements of sensors of your own: by the sensor's name, finite values by theirs."""
    sigma_m: float = 0.0
    """Standard deviation [m] of `pose_map` by the localisation itself, in the worse axis; 0: as the agent assumes."""
    sigma_rad: float = 0.0


class Base(Protocol):
    """Hardware of a two-wheeled robot."""

    def drive(self, twist: Twist, now: float) -> None:
        """Drive at `twist` from `now` on [s, monotonic]. `STILL` means brake; it comes whenever no command is valid."""

    def read(self, now: float) -> Reading | None:
        """Return the measurements at `now` [s, monotonic]; None if the hardware gives none: the driver is silent."""


class SimulatedBase:
    """Simulated motor with the mission's limits on an empty plane, from `start` in `map`; its scanner sees nothing.

    Like a good motor controller it brakes by itself when commands stop coming.
    """

    FIX_S = 0.1
    COMMAND_S_MAX = 0.25
    """Age [s] of the last command at which the motor controller brakes by itself: its driver has died or hangs."""
    BEAMS, RANGE_MIN_M, RANGE_MAX_M = 36, 0.1, 10.0
    TURN = 6.283185307179586
    STEP_S = 0.02

    def __init__(self, start: Pose2D, limits: Limits, now: float) -> None:
        self._start = start
        self._limits = limits
        self._pose_odom = Pose2D()
        self._twist, self._wanted = STILL, STILL
        self._odometer_m = 0.0
        self._at = now
        self._commanded_at = now
        self._fix_at = now

    def drive(self, twist: Twist, now: float) -> None:
        self._move(now)
        self._wanted, self._commanded_at = twist, now

    def read(self, now: float) -> Reading:
        self._move(now)
        if now < self._fix_at:
            return Reading(self._pose_odom, self._twist, self._odometer_m)
        self._fix_at = max(self._fix_at + self.FIX_S, now)
        pose_map = compose(self._start, self._pose_odom)
        nothing = (inf,) * self.BEAMS
        scan = Scan(-self.TURN / 2.0, self.TURN / self.BEAMS, self.RANGE_MIN_M, self.RANGE_MAX_M, nothing)
        return Reading(self._pose_odom, self._twist, self._odometer_m, pose_map, scan)

    def _move(self, now: float) -> None:
        """Integrate up to `now`: with the last command until that is too old, then braking to rest."""
        obeyed_until = self._commanded_at + self.COMMAND_S_MAX
        self._integrate(min(now, obeyed_until))
        if now > obeyed_until:
            self._wanted = STILL
            while self._at < now:
                self._integrate(min(now, self._at + self.STEP_S))

    def _integrate(self, until: float) -> None:
        """Integrate up to `until`: the twist moves towards the wanted one within the limits, then stays constant."""
        dt_s, self._at = max(0.0, until - self._at), max(until, self._at)
        limits = self._limits
        linear = min(limits.v_max_mps, max(-limits.v_reverse_max_mps, self._wanted.linear_x))
        angular = min(limits.omega_max_radps, max(-limits.omega_max_radps, self._wanted.angular_z))
        self._twist = Twist(
            _towards(self._twist.linear_x, linear, limits.a_max_mps2 * dt_s),
            _towards(self._twist.angular_z, angular, limits.alpha_max_radps2 * dt_s),
        )
        self._pose_odom = along_arc(self._pose_odom, self._twist, dt_s)
        self._odometer_m += abs(self._twist.linear_x) * dt_s


def _towards(now: float, wanted: float, step: float) -> float:
    return min(now + step, max(now - step, wanted))
