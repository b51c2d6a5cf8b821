"""Sensor models with noise, drop-out and outliers: odometry, localisation, scan and ground.

Each sensor of each robot has its own random generator, derived from the scenario's seed: an added sensor, or a robot
sampled more often, does not change the noise of the others. Standard deviations come from `Noise`; with all at zero,
no random number is drawn.
"""

from __future__ import annotations

from math import inf, nan
from random import Random

import numpy as np

from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc, wrap
from lfa.world.description.scenario import Lidar, Noise
from lfa.world.sensors.lidar import Floats

HEIGHT_OUTLIER_M = 0.1
"""Largest error [m] of an outlier height."""
HEIGHT_DIGITS = 4
"""Decimal places of a height [m]: the ground sensor resolves 0.1 mm."""


def chance_of(seed: int, robot_id: int, sensor: str) -> Random:
    """Return the random generator of one sensor of one robot; the same in every process for the same seed."""
    return Random(f"{seed}/robot{robot_id}/{sensor}")


class WheelOdometry:
    """Wheel odometry with a relative error per reading: continuous, and drifting (REP-105 `odom`)."""

    def __init__(self, noise: Noise, seed: int, robot_id: int) -> None:
        self._deviation = noise.odometry
        self._chance = chance_of(seed, robot_id, "odometry")
        self._errors = (0.0, 0.0)
        self.pose_odom = Pose2D()
        self.twist = STILL
        """Measured twist in `base_link`."""
        self.odometer_m = 0.0

    def redraw(self) -> None:
        """Draw new errors, once per reading: fractions of the wheels' linear and angular speed."""
        if self._deviation > 0.0:
            gauss = self._chance.gauss
            self._errors = gauss(0.0, self._deviation), gauss(0.0, self._deviation)

    def turn(self, wheels: Twist, duration_s: float) -> None:
        """Integrate the wheels' twist `wheels` over `duration_s`."""
        if self._deviation > 0.0:
            linear_error, angular_error = self._errors
            wheels = Twist(wheels.linear_x * (1.0 + linear_error), wheels.angular_z * (1.0 + angular_error))
        self.twist = wheels
        if wheels.linear_x == 0.0 and wheels.angular_z == 0.0:
            return
        self.pose_odom = along_arc(self.pose_odom, wheels, duration_s)
        self.odometer_m += abs(wheels.linear_x) * duration_s


class Localizer:
    """Localisation in `map` from an external source: noisy, sometimes missing, never drifting."""

    def __init__(self, noise: Noise, seed: int, robot_id: int) -> None:
        self._noise = noise
        self._chance = chance_of(seed, robot_id, "localization")

    def fix(self, pose_map: Pose2D) -> Pose2D | None:
        """Return the measured pose in `map`, or None if this fix drops out."""
        noise, chance = self._noise, self._chance
        if noise.localization_dropout > 0.0 and chance.random() < noise.localization_dropout:
            return None
        if noise.localization_m == 0.0 and noise.localization_rad == 0.0:
            return pose_map
        dx, dy = chance.gauss(0.0, noise.localization_m), chance.gauss(0.0, noise.localization_m)
        theta = wrap(pose_map.theta + chance.gauss(0.0, noise.localization_rad))
        return Pose2D(pose_map.x + dx, pose_map.y + dy, theta)


class RangeNoise:
    """Noise of a laser scanner: jitter on each range, outliers, and beams without a return (+inf)."""

    def __init__(self, noise: Noise, lidar: Lidar, seed: int, robot_id: int) -> None:
        self._noise = noise
        self._limits_m = lidar.range_min_m, lidar.range_max_m
        self._chance = np.random.default_rng(chance_of(seed, robot_id, "scan").getrandbits(64))

    def apply(self, ranges: Floats) -> tuple[float, ...]:
        """Return the measured ranges [m]; ranges out of bounds stay so, except for outliers."""
        noise, chance = self._noise, self._chance
        if noise.range_m > 0.0:
            finite = np.isfinite(ranges)
            jitter = chance.normal(0.0, noise.range_m, len(ranges))
            ranges = np.where(finite, np.maximum(ranges + jitter, 0.0), ranges)
        if noise.range_outlier > 0.0:
            wrong = chance.uniform(*self._limits_m, len(ranges))
            ranges = np.where(chance.random(len(ranges)) < noise.range_outlier, wrong, ranges)
        if noise.range_dropout > 0.0:
            ranges = np.where(chance.random(len(ranges)) < noise.range_dropout, inf, ranges)
        return tuple(ranges.tolist())


class HeightNoise:
    """Noise of the ground sensor: jitter on each height, outliers, and missing heights (nan)."""

    def __init__(self, noise: Noise, seed: int, robot_id: int) -> None:
        self._noise = noise
        self._chance = np.random.default_rng(chance_of(seed, robot_id, "ground").getrandbits(64))

    def apply(self, heights: Floats) -> tuple[tuple[float, ...], ...]:
        """Return the measured heights [m], one row per line; too deep (-inf) stays so, except for missing ones."""
        noise, chance, shape = self._noise, self._chance, heights.shape
        if noise.ground_m > 0.0:
            heights = heights + chance.normal(0.0, noise.ground_m, shape)
        if noise.ground_outlier > 0.0:
            wrong = chance.uniform(-HEIGHT_OUTLIER_M, HEIGHT_OUTLIER_M, shape)
            heights = np.where(chance.random(shape) < noise.ground_outlier, heights + wrong, heights)
        if noise.ground_dropout > 0.0:
            heights = np.where(chance.random(shape) < noise.ground_dropout, nan, heights)
        return tuple(map(tuple, heights.round(HEIGHT_DIGITS).tolist()))
