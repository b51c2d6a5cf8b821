"""Own pose in `map` from wheel odometry (50 Hz, smooth, drifting) and localisation (10 Hz, noisy, with gaps).

The state is the pose of `odom` in `map`: it changes only when a fix corrects it, so between fixes the pose is as smooth
as the odometry. A fix is compared with the odometry at the fix's own stamp. Gains are those of a Kalman filter over (x,
y, theta) whose uncertainty grows with the distance travelled and the angle turned; without noise the first fix is exact
and all later corrections are zero.
"""

from __future__ import annotations

from collections import deque
from math import hypot, isfinite

from msgspec import Struct

from lfa.agents.localization.clock_offset import ClockOffset
from lfa.agents.localization.covariance import Covariance
from lfa.agents.localization.plausibility import FrozenOdometry, HungLocalization, plausible
from lfa.protocol.geometry import Pose2D, Twist, along_arc, between, compose, inverse, part_of_arc, slowed, wrap
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import Localization, Sensors
from lfa.protocol.topics import TOPIC

ODOMETRY_KEPT = 64
GATE_SIGMA = 5.0
OUTLIERS_TO_RELOCATE = 5
"""Number of successive fixes that contradict the odometry after which the robot counts as carried or slipped."""
ODOMETRY_S_MAX = TOPIC["sensors"].timeout_s or 0.2
"""Least age [s] of the newest odometry beyond which there is no pose: nobody knows where the wheels went since."""
UNFIXED_SLOW_M, UNFIXED_M_MAX = 0.75, 1.5
"""Way [m] driven since the last accepted fix, from which a robot slows, and beyond which it has no pose: slip or a worn
wheel leads it astray by some centimetres a metre, which no noise model knows of."""
TURN_M_PER_RAD = 0.3
"""Way [m] that a turn of one radian counts as."""
UNFIXED_MPS = 0.2
"""Speed [m/s] at which a robot drives the last part of the way that it may drive without a fix, at most."""
SIGMA_M_MAX, SIGMA_RAD_MAX = 0.3, 0.35
"""Standard deviations of position [m] and heading [rad] beyond which there is no pose, and of a fix beyond which it is
none: by 20 degrees astray, a robot is 0.35 m off its line after one metre."""
JUMP_M, JUMP_M_PER_RAD = 0.04, 2.5
"""Correction of the pose by one fix from which what was seen before lies elsewhere in `map` than what is seen now: at
the robot, and for what is this far away, where a turn of one radian moves it by as much."""
BACKWARD_TO_RESTART = 10
"""Number of successive odometry messages with stamps before the newest one, after which the sender's clock counts as
set back."""


class EstimatorNoise(Struct, frozen=True, forbid_unknown_fields=True):
    """Assumed standard deviations of a fix, and of odometry after one metre, radian or second."""

    fix_m: float = 0.005
    fix_rad: float = 0.0087
    per_metre_m: float = 0.002
    per_metre_rad: float = 0.001
    per_radian_rad: float = 0.003
    per_second_m: float = 0.0003
    per_second_rad: float = 0.0005


NOISE = EstimatorNoise()


class _Odometry(Struct, frozen=True, gc=False):
    stamp: float
    pose_odom: Pose2D
    twist: Twist
    odometer_m: float


class Estimator:
    """Pose estimator of one robot. All stamps are of the driver's clock; its offset to the own clock is estimated
    here.
    """

    def __init__(self, noise: EstimatorNoise = NOISE, odometry_s_max: float = ODOMETRY_S_MAX) -> None:
        """`odometry_s_max`: age [s] of the newest odometry beyond which there is no pose."""
        self._noise = noise
        self._odometry_s_max = odometry_s_max
        self._clock = ClockOffset()
        self._wheels, self._hung = FrozenOdometry(), HungLocalization()
        self._incarnation: int | None = None
        self._history: deque[_Odometry] = deque(maxlen=ODOMETRY_KEPT)
        self._map_odom: Pose2D | None = None
        self._covariance = Covariance()
        self._fix_at: _Odometry | None = None
        self._pending: Localization | None = None
        self._outlier: Pose2D | None = None
        self._outliers_in_a_row, self._backward_in_a_row = 0, 0
        self.refused = 0
        self.outliers = 0
        self.relocations = 0
        self.jumps = 0
        """Number of corrections by more than `JUMP_M`."""
        self.hung_at: Pose2D | None = None
        """Place in `map` that the fixes say while the wheels drive on; None while they do not hang."""
        self.last_fix_at: float | None = None
        self._unfixed_m = 0.0

    def sensors(self, sensors: Sensors, received_at: float) -> bool:
        """Update with wheel odometry; return False when it is refused (not finite, implausible, out of order)."""
        header = sensors.header
        if header.incarnation != self._incarnation or self._is_set_back(header.stamp):
            self._restart(header.incarnation)
        newest = self._history[-1].stamp if self._history else None
        fine = plausible(sensors.pose_odom, sensors.twist) and isfinite(sensors.odometer_m)
        if not fine or (newest is not None and header.stamp <= newest):
            self.refused += 1
            return False
        if not self._clock.heard(header.stamp, received_at):
            self.refused += 1
            return False
        if self._history:
            last = self._history[-1]
            turn = abs(wrap(sensors.pose_odom.theta - last.pose_odom.theta))
            self._unfixed_m += abs(sensors.odometer_m - last.odometer_m) + TURN_M_PER_RAD * turn
        self._wheels.update(sensors.pose_odom, sensors.twist, header.stamp)
        self._history.append(_Odometry(header.stamp, sensors.pose_odom, sensors.twist, sensors.odometer_m))
        if self._pending is not None and header.stamp >= self._pending.header.stamp:
            fix, self._pending = self._pending, None
            self._correct(fix)
        return True

    def localization(self, fix: Localization, received_at: float) -> bool:
        """Accept a fix, applied as soon as the odometry reaches its stamp; return False when it is refused."""
        stamp = fix.header.stamp
        sure = fix.sigma_m <= SIGMA_M_MAX and fix.sigma_rad <= SIGMA_RAD_MAX
        if not (isfinite(stamp) and plausible(fix.pose_map, Twist()) and sure):
            self.refused += 1
            return False
        if self._history and stamp < self._history[0].stamp:
            self.refused += 1
            return False
        hangs = bool(self._history) and self._hung.update(fix.pose_map, self._history[-1].pose_odom)
        self.hung_at = fix.pose_map if hangs else None
        if hangs:
            self.refused += 1
            return False
        self.last_fix_at = received_at
        if not self._history or stamp > self._history[-1].stamp:
            self._pending = fix
            return True
        self._correct(fix)
        return True

    def missing(self, now: float) -> str | None:
        """Return the input without which there is no pose, `odometry` or `localization`; None when there is one.

        There is one from the first fix on that could be joined to the odometry, while the odometry is fresh and the
        robot has not driven far since the last fix.
        """
        if self._wheels.frozen or self.age_s(now) > self._odometry_s_max:
            return "odometry"
        unsure = self._covariance.position_m > SIGMA_M_MAX or self._covariance.heading_rad > SIGMA_RAD_MAX
        lost = self._map_odom is None or self._unfixed_m > UNFIXED_M_MAX or unsure
        return "localization" if lost else None

    @property
    def unfixed(self) -> bool:
        """True when the robot has driven so far without a fix that it slows."""
        return self._map_odom is not None and self._unfixed_m > UNFIXED_SLOW_M

    def limited(self, wanted: Twist) -> Twist:
        """Return `wanted`, slowed where the robot has driven far without a fix."""
        return slowed(wanted, UNFIXED_MPS) if self.unfixed else wanted

    @property
    def odometer_m(self) -> float:
        return self._history[-1].odometer_m if self._history else 0.0

    def pose_at(self, now: float) -> tuple[Pose2D, Twist] | None:
        """Return own pose in `map`, extrapolated along the arc to `now`, and own twist; None without a pose
        (`missing`).
        """
        if self._map_odom is None or self.missing(now) is not None:
            return None
        newest = self._history[-1]
        age = now - newest.stamp - self._clock.offset(now)
        age = min(self._odometry_s_max, max(0.0, age))
        here = compose(self._map_odom, newest.pose_odom)
        return along_arc(here, newest.twist, age), newest.twist

    def age_s(self, now: float) -> float:
        """Return the age of the newest odometry [s]; infinite before the first."""
        return now - self._history[-1].stamp - self._clock.offset(now) if self._history else float("inf")

    def late_s(self, header: Header, now: float) -> float:
        """Return how long [s] a message of the own hardware took to arrive at `now`, by the clock of the odometry.

        0 before the first odometry, and for a message of another driver than that of the odometry.
        """
        if header.incarnation != self._incarnation or not self._clock.known:
            return 0.0
        return now - header.stamp - self._clock.offset(now)

    def _is_set_back(self, stamp: float) -> bool:
        """Return True at the last of many stamps in a row before the newest: the sender's clock was set back.

        Its odometry would otherwise be refused until that clock has caught up, for hours or days.
        """
        backward = bool(self._history) and stamp < self._history[-1].stamp
        self._backward_in_a_row = self._backward_in_a_row + 1 if backward else 0
        return self._backward_in_a_row >= BACKWARD_TO_RESTART

    def _restart(self, incarnation: int) -> None:
        """Restart for a new driver, or one with a new clock: `odom` may be another."""
        self._incarnation = incarnation
        self._clock, self._wheels, self._hung = ClockOffset(), FrozenOdometry(), HungLocalization()
        self._history.clear()
        self._map_odom = self._pending = self.hung_at = None
        self._backward_in_a_row = 0

    def _correct(self, fix: Localization) -> None:
        odometry = _at(self._history, fix.header.stamp)
        if self._map_odom is None:
            self._unfixed_m = 0.0
            self._relocate(fix, odometry)
            return
        predicted = compose(self._map_odom, odometry.pose_odom)
        self._grow(odometry, predicted)
        innovation = (
            fix.pose_map.x - predicted.x,
            fix.pose_map.y - predicted.y,
            wrap(fix.pose_map.theta - predicted.theta),
        )
        variances = self._fix_variances(fix)
        if not self._covariance.admits(innovation, variances, GATE_SIGMA):
            self._refuse_outlier(fix, odometry)
            return
        self._outliers_in_a_row, self._unfixed_m = 0, 0.0
        dx, dy, dtheta = self._covariance.update(innovation, variances)
        self.jumps += hypot(dx, dy) + JUMP_M_PER_RAD * abs(dtheta) > JUMP_M
        corrected = Pose2D(predicted.x + dx, predicted.y + dy, wrap(predicted.theta + dtheta))
        self._map_odom = compose(corrected, inverse(odometry.pose_odom))

    def _grow(self, odometry: _Odometry, predicted: Pose2D) -> None:
        """Add the uncertainty of the motion since the last fix."""
        last, noise = self._fix_at, self._noise
        assert last is not None
        assert self._map_odom is not None
        before = compose(self._map_odom, last.pose_odom)
        way_m = abs(odometry.odometer_m - last.odometer_m)
        turn = abs(wrap(odometry.pose_odom.theta - last.pose_odom.theta))
        elapsed = max(0.0, odometry.stamp - last.stamp)
        self._covariance.move(predicted.x - before.x, predicted.y - before.y)
        self._covariance.grow(
            noise.per_metre_m**2 * way_m + noise.per_second_m**2 * elapsed,
            noise.per_metre_rad**2 * way_m + noise.per_radian_rad**2 * turn + noise.per_second_rad**2 * elapsed,
        )
        self._fix_at = odometry

    def _fix_variances(self, fix: Localization) -> tuple[float, float]:
        return max(self._noise.fix_m, fix.sigma_m) ** 2, max(self._noise.fix_rad, fix.sigma_rad) ** 2

    def _refuse_outlier(self, fix: Localization, odometry: _Odometry) -> None:
        """Count an outlier; relocate when several in a row agree with each other and not with the odometry."""
        self.outliers += 1
        self._outliers_in_a_row += 1
        if self._outlier is not None and not _near(between(self._outlier, fix.pose_map), self._noise):
            self._outliers_in_a_row = 1
        self._outlier = fix.pose_map
        if self._outliers_in_a_row >= OUTLIERS_TO_RELOCATE:
            self.relocations += 1
            self.jumps += 1
            self._relocate(fix, odometry)

    def _relocate(self, fix: Localization, odometry: _Odometry) -> None:
        """Place the robot at `fix`. How far it has driven without a fix is forgotten only if the fixes go along with
        the wheels: a localization that hangs contradicts them again and again.
        """
        if self._hung.agrees:
            self._unfixed_m = 0.0
        self._map_odom = compose(fix.pose_map, inverse(odometry.pose_odom))
        self._fix_at = odometry
        self._covariance = Covariance(*self._fix_variances(fix))
        self._outliers_in_a_row = 0


def _near(step: Pose2D, noise: EstimatorNoise) -> bool:
    """Return whether two fixes one period apart can be of one robot: within half a metre and half a radian."""
    return abs(step.x) + abs(step.y) < 0.5 + 10.0 * noise.fix_m and abs(step.theta) < 0.5


def _at(history: deque[_Odometry], stamp: float) -> _Odometry:
    """Return the odometry at `stamp`, interpolated along the arc between two samples. `stamp` lies within `history`."""
    later = history[-1]
    for sample in reversed(history):
        if sample.stamp <= stamp:
            earlier = sample
            break
        later = sample
    else:
        return history[0]
    if later.stamp <= earlier.stamp:
        return earlier
    part = (stamp - earlier.stamp) / (later.stamp - earlier.stamp)
    if part <= 0.0:
        return earlier
    step = between(earlier.pose_odom, later.pose_odom)
    return _Odometry(
        stamp,
        compose(earlier.pose_odom, part_of_arc(step, part)),
        later.twist,
        earlier.odometer_m + part * (later.odometer_m - earlier.odometer_m),
    )
