"""Own pose from odometry and localisation: exact without noise, much better than the raw fix with it."""

from __future__ import annotations

from math import hypot, inf, pi, sin, sqrt
from random import Random

import pytest

from lfa.agents.localization.estimator import (
    ODOMETRY_S_MAX,
    OUTLIERS_TO_RELOCATE,
    SIGMA_M_MAX,
    SIGMA_RAD_MAX,
    UNFIXED_M_MAX,
    Estimator,
)
from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc, wrap
from lfa.protocol.messages.consensus import NO_TERM, GatewayStamp
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import Localization, Sensors

DT = 0.02


class Drive:
    """One robot's true motion and what its hardware says of it."""

    def __init__(
        self,
        *,
        noise_m: float = 0.0,
        noise_rad: float = 0.0,
        odometry: float = 0.0,
        dropout: float = 0.0,
        offset_s: float = 0.0,
    ) -> None:
        self.estimator = Estimator()
        self.true, self.odom = Pose2D(2.0, -1.0, 0.4), Pose2D()
        self.now, self.odometer_m = 0.0, 0.0
        self._noise = noise_m, noise_rad, odometry, dropout, offset_s
        self.chance = Random(11)
        self._tick = 0

    def step(self, twist: Twist, fix: Pose2D | None = None, *, silent: bool = False) -> tuple[float, float]:
        """(position error [m], heading error [rad]) before a step with `twist`, infinite without a pose.

        `fix` overrides the localisation.
        """
        noise_m, noise_rad, odometry, dropout, offset_s = self._noise
        gauss = self.chance.gauss
        header = Header("driver", 1, self._tick, self.now - offset_s)
        measured = Twist(twist.linear_x * (1.0 + gauss(0.0, odometry)), twist.angular_z * (1.0 + gauss(0.0, odometry)))
        sensors = Sensors(header, self.odom, measured, self.odometer_m, GatewayStamp(1, self.now), NO_TERM)
        self.estimator.sensors(sensors, self.now + 0.003)
        if fix is None and self._tick % 5 == 0 and self.chance.random() >= dropout and not silent:
            t = self.true
            fix = Pose2D(t.x + gauss(0.0, noise_m), t.y + gauss(0.0, noise_m), wrap(t.theta + gauss(0.0, noise_rad)))
        if fix is not None:
            self.estimator.localization(Localization(header, fix), self.now + 0.003)
        known = self.estimator.pose_at(self.now + 0.003)
        error = (inf, inf)
        if known is not None:
            pose = known[0]
            error = hypot(pose.x - self.true.x, pose.y - self.true.y), abs(wrap(pose.theta - self.true.theta))
        self.true = along_arc(self.true, twist, DT)
        self.odom = along_arc(self.odom, measured, DT)
        self.odometer_m += abs(measured.linear_x) * DT
        self.now += DT
        self._tick += 1
        return error


def _wander(n: int) -> Twist:
    return Twist(0.5 + 0.3 * sin(0.01 * n), 0.6 * sin(0.013 * n))


@pytest.mark.parametrize("offset_s", [0.0, 3.0, 864000.0])
def test_without_noise_the_pose_is_exact_whatever_the_drivers_clock(offset_s: float) -> None:
    drive = Drive(offset_s=offset_s)
    errors = [drive.step(_wander(n)) for n in range(3000)]
    assert max(e[0] for e in errors) < 1e-6
    assert max(e[1] for e in errors) < 1e-6


def test_between_two_samples_the_pose_moves_on_along_the_arc() -> None:
    drive = Drive()
    for _ in range(100):
        drive.step(Twist(0.5, 0.4))
    known = drive.estimator.pose_at(drive.now - DT + 0.003 + 0.013)
    assert known is not None
    true = along_arc(along_arc(drive.true, Twist(0.5, 0.4), -DT), Twist(0.5, 0.4), 0.013)
    assert hypot(known[0].x - true.x, known[0].y - true.y) < 1e-9


def test_with_noise_and_drop_outs_the_error_is_less_than_a_third_of_the_fixes() -> None:
    """5 mm and 0.5 degrees at 10 Hz, one fix in five missing, wheels 1 % wrong."""
    drive = Drive(noise_m=0.005, noise_rad=0.5 * pi / 180.0, odometry=0.01, dropout=0.2)
    errors = [drive.step(_wander(n)) for n in range(6000)][1000:]
    position = sqrt(sum(e[0] ** 2 for e in errors) / len(errors))
    heading = sqrt(sum(e[1] ** 2 for e in errors) / len(errors))
    assert position < 0.005 * sqrt(2.0) / 3.0
    assert heading < 0.5 * pi / 180.0 / 3.0


def test_outliers_are_left_out_and_counted() -> None:
    drive = Drive(noise_m=0.005, noise_rad=0.009)
    worst = 0.0
    for n in range(2000):
        stray = Pose2D(drive.true.x + 1.0, drive.true.y, drive.true.theta) if n % 50 == 25 else None
        error, _ = drive.step(_wander(n), stray)
        worst = max(worst, error if n > 300 else 0.0)
    assert drive.estimator.outliers == 40
    assert worst < 0.01


def test_a_robot_that_was_carried_is_found_after_five_fixes_that_agree() -> None:
    drive = Drive(noise_m=0.001)
    for _ in range(500):
        drive.step(STILL)
    drive.true = Pose2D(8.0, 3.0, -2.0)
    for _ in range(5 * OUTLIERS_TO_RELOCATE + 1):
        error, _ = drive.step(STILL)
    assert drive.estimator.relocations == 1
    assert error < 0.01


def test_a_gap_in_localisation_is_bridged_by_the_wheels() -> None:
    drive = Drive(odometry=0.005)
    for n in range(500):
        drive.step(_wander(n))
    errors = [drive.step(_wander(n), silent=True) for n in range(500, 590)]
    assert drive.estimator.missing(drive.now) is None
    assert errors[-1][0] < 0.02


def test_a_localization_that_ended_slows_the_robot_and_then_is_no_pose_until_the_next_fix() -> None:
    drive = Drive()
    for _ in range(100):
        drive.step(Twist(0.5, 0.0))
    go, way_m = Twist(0.5, 0.2), 0.0
    assert drive.estimator.limited(go) == go
    while way_m < UNFIXED_M_MAX - 0.1:
        drive.step(Twist(0.5, 0.0), silent=True)
        way_m += 0.5 * DT
    assert drive.estimator.unfixed
    assert drive.estimator.limited(go) == Twist(pytest.approx(0.2), pytest.approx(0.08))
    for _ in range(12):
        drive.step(Twist(0.5, 0.0), silent=True)
    assert drive.estimator.missing(drive.now) == "localization"
    assert drive.estimator.pose_at(drive.now) is None
    for _ in range(6):
        drive.step(STILL)
    assert drive.estimator.pose_at(drive.now) is not None
    assert drive.estimator.limited(go) == go


@pytest.mark.parametrize(("jitter_m", "mps"), [(0.0, 0.5), (0.0, 0.1), (0.005, 0.5), (0.005, 0.2)])
def test_a_localization_that_says_one_place_while_the_wheels_drive_on_is_none(jitter_m: float, mps: float) -> None:
    """It contradicts the wheels again and again, as a robot does once that was carried."""
    drive = Drive()
    for _ in range(100):
        drive.step(Twist(0.5, 0.0))
    hung, gauss = drive.true, drive.chance.gauss
    for _ in range(round(2.5 / mps / DT)):
        drive.step(Twist(mps, 0.0), Pose2D(hung.x + gauss(0.0, jitter_m), hung.y + gauss(0.0, jitter_m), hung.theta))
    assert drive.estimator.missing(drive.now) == "localization"
    at = drive.estimator.hung_at
    assert at is not None and hypot(at.x - hung.x, at.y - hung.y) < 0.05
    for _ in range(60):
        drive.step(STILL)
    assert drive.step(STILL)[0] < 0.02, "it says where the robot is, again"
    assert drive.estimator.hung_at is None


def test_fixes_that_err_more_than_they_say_and_go_along_with_the_wheels_are_no_hung_localization() -> None:
    drive = Drive(noise_m=0.07, noise_rad=0.05)
    for n in range(3000):
        drive.step(Twist(0.5, 0.0))
        assert drive.estimator.missing(drive.now) is None, f"after {n} steps"


def test_a_robot_that_stands_keeps_its_pose_without_fixes() -> None:
    drive = Drive()
    for _ in range(50):
        drive.step(Twist(0.5, 0.0))
    for _ in range(3000):
        drive.step(STILL, silent=True)
    assert drive.estimator.missing(drive.now) is None


def test_fixes_that_are_all_refused_are_no_fixes() -> None:
    drive = Drive()
    for _ in range(50):
        drive.step(Twist(0.5, 0.0))
    for n in range(200):
        wrong = Pose2D(drive.true.x + (5.0 if n % 2 else -5.0), drive.true.y, 0.0)
        drive.step(Twist(0.5, 0.0), fix=wrong)
    assert drive.estimator.missing(drive.now) == "localization"


def test_a_fix_that_says_itself_how_wrong_it_may_be_is_none_beyond_the_bound() -> None:
    drive = Drive()
    header = Header("driver", 1, 0, 0.0)
    sensors = Sensors(header, Pose2D(), STILL, 0.0, GatewayStamp(1, 0.0), NO_TERM)
    drive.estimator.sensors(sensors, 0.0)
    assert not drive.estimator.localization(Localization(header, Pose2D(), sigma_m=SIGMA_M_MAX + 0.01), 0.0)
    assert drive.estimator.missing(0.0) == "localization"
    assert drive.estimator.localization(Localization(header, Pose2D(), sigma_m=SIGMA_M_MAX), 0.0)
    assert drive.estimator.missing(0.0) is None


def test_odometry_that_stopped_is_no_pose() -> None:
    drive = Drive()
    for _ in range(50):
        drive.step(Twist(0.5, 0.0))
    assert drive.estimator.missing(drive.now + ODOMETRY_S_MAX - 0.05) is None
    assert drive.estimator.missing(drive.now + ODOMETRY_S_MAX + 0.05) == "odometry"
    assert drive.estimator.pose_at(drive.now + ODOMETRY_S_MAX + 0.05) is None


def test_a_restarted_driver_with_a_new_clock_and_odometry_is_taken_up_at_its_first_fix() -> None:
    drive = Drive()
    for _ in range(100):
        drive.step(Twist(0.5, 0.0))
    header = Header("driver", 2, 0, 5.0)
    drive.estimator.sensors(Sensors(header, Pose2D(), STILL, 0.0, GatewayStamp(2, 0.0), NO_TERM), received_at=drive.now)
    assert drive.estimator.pose_at(drive.now) is None
    drive.estimator.localization(Localization(header, Pose2D(4.0, 5.0, 1.0)), received_at=drive.now)
    known = drive.estimator.pose_at(drive.now)
    assert known is not None
    assert (known[0].x, known[0].y, known[0].theta) == pytest.approx((4.0, 5.0, 1.0))


def test_absurd_and_old_readings_are_refused_and_counted() -> None:
    drive = Drive()
    for _ in range(10):
        drive.step(STILL)
    nan = float("nan")
    stamp = GatewayStamp(1, 0.0)
    before = drive.estimator.pose_at(drive.now)
    for sent_at, pose, twist in (
        (nan, Pose2D(), STILL),
        (0.0, Pose2D(), STILL),
        (drive.now, Pose2D(nan, 0.0, 0.0), STILL),
        (drive.now, Pose2D(), Twist(nan, 0.0)),
        (drive.now, Pose2D(1e12, 0.0, 0.0), STILL),
    ):
        header = Header("driver", 1, 99, sent_at)
        assert not drive.estimator.sensors(Sensors(header, pose, twist, 0.0, stamp, NO_TERM), drive.now)
        if pose.x != 0.0 or sent_at != drive.now:
            drive.estimator.localization(Localization(header, Pose2D(nan, 0.0, 0.0)), drive.now)
    assert drive.estimator.refused >= 5
    assert drive.estimator.pose_at(drive.now) == before


@pytest.mark.parametrize("wrong", [SIGMA_RAD_MAX + 0.01, float("nan"), float("inf")])
def test_a_fix_whose_heading_is_uncertain_is_none(wrong: float) -> None:
    drive = Drive()
    header = Header("driver", 1, 0, 0.0)
    drive.estimator.sensors(Sensors(header, Pose2D(), STILL, 0.0, GatewayStamp(1, 0.0), NO_TERM), 0.0)
    assert not drive.estimator.localization(Localization(header, Pose2D(), 0.0, wrong), 0.0)
    assert not drive.estimator.localization(Localization(header, Pose2D(), wrong, 0.0), 0.0)
    assert drive.estimator.missing(0.0) == "localization"


def test_odometry_that_repeats_itself_under_fresh_stamps_and_says_that_it_moves_is_none() -> None:
    drive = Drive()
    for _ in range(50):
        drive.step(Twist(0.3, 0.0))
    frozen = drive.odom
    for _ in range(30):
        drive.step(Twist(0.3, 0.0))
        drive.odom = frozen
    assert drive.estimator.missing(drive.now) == "odometry"
    for _ in range(5):
        drive.step(Twist(0.3, 0.0))
    assert drive.estimator.missing(drive.now) is None, "it moves again"


def test_odometry_that_jitters_about_one_place_and_says_that_it_moves_is_none() -> None:
    drive = Drive()
    for _ in range(50):
        drive.step(Twist(0.3, 0.0))
    frozen = drive.odom
    for n in range(60):
        drive.step(Twist(0.3, 0.0))
        drive.odom = Pose2D(frozen.x + 1e-4 * (n % 3), frozen.y, frozen.theta)
    assert drive.estimator.missing(drive.now) == "odometry"
    for _ in range(5):
        drive.step(Twist(0.01, 0.0))
    assert drive.estimator.missing(drive.now) is None, "it says that it rests, as it does"


def test_a_gyroscope_that_drifts_at_rest_is_no_frozen_odometry() -> None:
    drive = Drive()
    for _ in range(3000):
        drive.step(Twist(0.0, 0.05))
        drive.odom = drive.true = Pose2D(2.0, -1.0, 0.4)
        assert drive.estimator.missing(drive.now) is None


@pytest.mark.parametrize("back_s", [1.0, 3600.0, 30 * 86400.0])
def test_a_driver_whose_clock_is_set_back_or_forward_loses_its_pose_for_a_moment(back_s: float) -> None:
    drive = Drive()
    for _ in range(50):
        drive.step(Twist(0.3, 0.0))
    for offset_s in (back_s, 0.0):
        drive._noise = (0.0, 0.0, 0.0, 0.0, offset_s)
        errors = [drive.step(Twist(0.3, 0.0)) for _ in range(50)]
        assert drive.estimator.missing(drive.now) is None
        assert max(error for error, _ in errors[30:]) < 0.01


def test_how_late_a_message_of_the_own_hardware_comes() -> None:
    drive = Drive(offset_s=5.0)
    assert drive.estimator.late_s(Header("driver", 1, 0, 0.0), 9.0) == 0.0
    for _ in range(50):
        drive.step(STILL)
    assert drive.estimator.late_s(Header("driver", 1, 0, drive.now - 5.0), drive.now + 1.0) == pytest.approx(
        1.0, abs=0.01
    )
    assert drive.estimator.late_s(Header("driver", 2, 0, 0.0), drive.now + 1.0) == 0.0
