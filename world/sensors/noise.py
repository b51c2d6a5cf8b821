"""What a robot's own hardware would say: odometry, localisation, scan, ground; with noise, drop-out and outliers.

Each robot and sensor has its own generator, derived from the scenario's seed: a sensor more, or a robot that is asked
more often, changes nobody else's noise. Standard deviations come from `Noise`; with all at zero, nothing is drawn.
"""

from __future__ import annotations

from math import inf, nan
from random import Random

import numpy as np

from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc, wrap
from lfa.world.description.scenario import Lidar, Noise
from lfa.world.sensors.lidar import Floats

HEIGHT_OUTLIER_M = 0.1
"""A bad height is off by up to this much."""
HEIGHT_DIGITS = 4
"""The ground sensor resolves 0.1 mm."""


def chance_of(seed: int, robot_id: int, sensor: str) -> Random:
    """The generator of one sensor of one robot; the same in every process for the same seed."""
    return Random(f"{seed}/robot{robot_id}/{sensor}")


class WheelOdometry:
    """Counts what the wheels turn, each reading a little wrong: continuous, and drifting (REP-105 `odom`)."""

    def __init__(self, noise: Noise, seed: int, robot_id: int) -> None:
        self._deviation = noise.odometry
        self._chance = chance_of(seed, robot_id, "odometry")
        self._errors = (0.0, 0.0)
        self.pose_odom = Pose2D()
        self.twist = STILL
        """As measured, in `base_link`."""
        self.odometer_m = 0.0

    def redraw(self) -> None:
        """New errors, once a reading: a fraction of the wheels' speed each for way and turn."""
        if self._deviation > 0.0:
            gauss = self._chance.gauss
            self._errors = gauss(0.0, self._deviation), gauss(0.0, self._deviation)

    def turn(self, wheels: Twist, duration_s: float) -> None:
        """The wheels turned for `wheels` during `duration_s`."""
        if self._deviation > 0.0:
            linear_error, angular_error = self._errors
            wheels = Twist(wheels.linear_x * (1.0 + linear_error), wheels.angular_z * (1.0 + angular_error))
        self.twist = wheels
        if wheels.linear_x == 0.0 and wheels.angular_z == 0.0:
            return
        self.pose_odom = along_arc(self.pose_odom, wheels, duration_s)
        self.odometer_m += abs(wheels.linear_x) * duration_s


class Localizer:
    """Pose in `map` from outside: noisy, sometimes missing, never drifting."""

    def __init__(self, noise: Noise, seed: int, robot_id: int) -> None:
        self._noise = noise
        self._chance = chance_of(seed, robot_id, "localization")

    def fix(self, pose_map: Pose2D) -> Pose2D | None:
        """The measured pose, None when this fix is missing."""
        noise, chance = self._noise, self._chance
        if noise.localization_dropout > 0.0 and chance.random() < noise.localization_dropout:
            return None
        if noise.localization_m == 0.0 and noise.localization_rad == 0.0:
            return pose_map
        dx, dy = chance.gauss(0.0, noise.localization_m), chance.gauss(0.0, noise.localization_m)
        theta = wrap(pose_map.theta + chance.gauss(0.0, noise.localization_rad))
        return Pose2D(pose_map.x + dx, pose_map.y + dy, theta)


class RangeNoise:
    """What a real scanner makes of exact ranges: jitter on each, wrong ones, and beams that do not come back (+inf)."""

    def __init__(self, noise: Noise, lidar: Lidar, seed: int, robot_id: int) -> None:
        self._noise = noise
        self._limits_m = lidar.range_min_m, lidar.range_max_m
        self._chance = np.random.default_rng(chance_of(seed, robot_id, "scan").getrandbits(64))

    def apply(self, ranges: Floats) -> tuple[float, ...]:
        """The ranges [m] as measured; what was out of range stays so, but for outliers."""
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
    """What a real range sensor makes of exact heights: jitter on each, wrong ones, and missing ones (nan)."""

    def __init__(self, noise: Noise, seed: int, robot_id: int) -> None:
        self._noise = noise
        self._chance = np.random.default_rng(chance_of(seed, robot_id, "ground").getrandbits(64))

    def apply(self, heights: Floats) -> tuple[tuple[float, ...], ...]:
        """The heights [m], one row a line, as measured; too deep (-inf) stays so, but for missing ones."""
        noise, chance, shape = self._noise, self._chance, heights.shape
        if noise.ground_m > 0.0:
            heights = heights + chance.normal(0.0, noise.ground_m, shape)
        if noise.ground_outlier > 0.0:
            wrong = chance.uniform(-HEIGHT_OUTLIER_M, HEIGHT_OUTLIER_M, shape)
            heights = np.where(chance.random(shape) < noise.ground_outlier, heights + wrong, heights)
        if noise.ground_dropout > 0.0:
            heights = np.where(chance.random(shape) < noise.ground_dropout, nan, heights)
        return tuple(map(tuple, heights.round(HEIGHT_DIGITS).tolist()))
