"""Sensors: each has its own seeded generator, and says what it measured in the way that agents expect."""

from __future__ import annotations

import subprocess
import sys
from math import inf, isinf
from random import Random
from statistics import stdev

import numpy as np
import pytest

from lfa.protocol.geometry import Pose2D, Twist, along_arc, distance
from lfa.world.description.scenario import Lidar, Noise
from lfa.world.sensors import noise as sensors
from lfa.world.sensors.noise import HEIGHT_OUTLIER_M, HeightNoise, Localizer, RangeNoise, WheelOdometry

NOISY = Noise(
    localization_m=0.005,
    localization_rad=0.0087,
    localization_dropout=0.2,
    odometry=0.02,
    range_m=0.01,
    range_dropout=0.1,
)


def readings(seed: int, robot_id: int) -> tuple[object, ...]:
    """A few readings of every noisy sensor of one robot."""
    odometry, localizer = WheelOdometry(NOISY, seed, robot_id), Localizer(NOISY, seed, robot_id)
    ranges = RangeNoise(NOISY, Lidar(), seed, robot_id)
    for _ in range(20):
        odometry.redraw()
        odometry.turn(Twist(0.5, 0.1), 0.02)
    fixes = tuple(localizer.fix(Pose2D()) for _ in range(20))
    return odometry.pose_odom, fixes, ranges.apply(np.full(30, 2.0))


def test_the_same_seed_gives_the_same_noise() -> None:
    assert readings(7, 2) == readings(7, 2)


def test_another_seed_or_another_robot_has_other_noise_in_every_sensor() -> None:
    for other in (readings(8, 2), readings(7, 3)):
        assert all(a != b for a, b in zip(readings(7, 2), other, strict=True))


def test_noise_from_an_unseeded_generator_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    """The planted bug: were a sensor's generator not derived from the seed, the claim above would fail."""
    monkeypatch.setattr(sensors, "chance_of", lambda *_: Random())
    assert readings(7, 2) != readings(7, 2)


def test_noise_is_the_same_under_any_hash_seed() -> None:
    code = "from tests.world.sensors.test_noise import readings; print(readings(7, 2))"
    code = f"import sys; sys.path.insert(0, '.'); {code}"
    printed = {
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True, env={"PYTHONHASHSEED": seed}
        ).stdout
        for seed in ("0", "1")
    }
    assert printed == {f"{readings(7, 2)}\n"}


def test_without_noise_odometry_is_the_way_that_the_wheels_turned() -> None:
    odometry, pose = WheelOdometry(Noise(), 1, 1), Pose2D()
    for twist in (Twist(0.5, 0.3), Twist(-0.2, 1.0), Twist(0.0, 0.5)):
        for _ in range(50):
            odometry.redraw()
            odometry.turn(twist, 0.01)
            pose = along_arc(pose, twist, 0.01)
    assert odometry.pose_odom == pose
    assert odometry.odometer_m == pytest.approx(0.35)
    assert odometry.twist == Twist(0.0, 0.5)


def test_odometry_drifts_with_noise_and_never_jumps() -> None:
    odometry, last = WheelOdometry(NOISY, 1, 1), Pose2D()
    for _ in range(3000):
        odometry.redraw()
        odometry.turn(Twist(0.5, 0.0), 0.02)
        assert distance(odometry.pose_odom, last) < 0.011
        last = odometry.pose_odom
    assert abs(odometry.pose_odom.x - 30.0) + abs(odometry.pose_odom.y) > 1e-3


def test_a_robot_at_rest_has_an_odometry_at_rest() -> None:
    odometry = WheelOdometry(NOISY, 1, 1)
    odometry.redraw()
    odometry.turn(Twist(0.0, 0.0), 0.02)
    assert (odometry.pose_odom, odometry.twist, odometry.odometer_m) == (Pose2D(), Twist(0.0, 0.0), 0.0)


def test_fixes_scatter_as_stated_and_some_are_missing() -> None:
    localizer = Localizer(NOISY, 1, 1)
    fixes = [localizer.fix(Pose2D(3.0, 4.0, 3.14159)) for _ in range(4000)]
    there = [fix for fix in fixes if fix is not None]
    assert len(there) == pytest.approx(3200, rel=0.05)
    assert stdev(fix.x for fix in there) == pytest.approx(0.005, rel=0.1)
    assert max(abs(fix.theta) for fix in there) <= 3.1416


def test_scan_noise_leaves_inf_alone_and_dropped_beams_are_inf() -> None:
    noise = RangeNoise(NOISY, Lidar(), 1, 1)
    measured = noise.apply(np.array([inf, -inf, *[2.0] * 2000]))
    assert measured[0] == inf
    assert measured[1] in (-inf, inf)
    back = [r for r in measured[2:] if not isinf(r)]
    assert len(back) == pytest.approx(1800, rel=0.05)
    assert stdev(back) == pytest.approx(0.01, rel=0.1)
    assert inf in measured[2:]


def test_a_clean_scan_is_exact() -> None:
    assert RangeNoise(Noise(), Lidar(), 1, 1).apply(np.array([1.25, inf])) == (1.25, inf)


@pytest.mark.parametrize(
    ("noise", "moves", "turns"),
    [
        (Noise(localization_m=0.01), True, False),
        (Noise(localization_rad=0.01), False, True),
        (Noise(), False, False),
    ],
)
def test_a_fix_has_the_noise_that_is_asked_for_and_no_other(noise: Noise, moves: bool, turns: bool) -> None:
    fix = Localizer(noise, 1, 1).fix(Pose2D(1.0, 2.0, 0.5))
    assert fix is not None
    assert ((fix.x, fix.y) != (1.0, 2.0), fix.theta != 0.5) == (moves, turns)


def test_wrong_heights_lie_on_both_sides_of_the_right_one() -> None:
    heights = np.array(HeightNoise(Noise(ground_outlier=0.5), 1, 1).apply(np.zeros((3, 200))))
    assert heights.min() < -0.05
    assert heights.max() > 0.05
    assert abs(heights).max() <= HEIGHT_OUTLIER_M
