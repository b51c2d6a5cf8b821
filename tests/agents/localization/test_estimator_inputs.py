"""What one reading changes in the estimator: what is counted, what waits, what a gap or a new driver leaves."""

from __future__ import annotations

from math import pi

import pytest
from msgspec.structs import replace

from lfa.agents.localization.estimator import (
    BACKWARD_TO_RESTART,
    ODOMETRY_S_MAX,
    OUTLIERS_TO_RELOCATE,
    SIGMA_RAD_MAX,
    UNFIXED_M_MAX,
    Estimator,
    EstimatorNoise,
)
from lfa.protocol.geometry import STILL, Pose2D
from lfa.protocol.messages.consensus import NO_TERM, GatewayStamp
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import Localization, Sensors

NAN = float("nan")
ORIGIN = Pose2D()
SURE = EstimatorNoise(fix_m=1e-6, fix_rad=1e-6, per_metre_m=0.0, per_metre_rad=0.0, per_radian_rad=0.0,
                      per_second_m=0.0, per_second_rad=0.0)  # fmt: skip
"""A robot whose odometry is exact: whatever a fix says beside it is an outlier."""


def odometry(at: float, pose: Pose2D = ORIGIN, odometer_m: float = 0.0, *, driver: int = 1) -> Sensors:
    return Sensors(Header("driver", driver, 1, at), pose, STILL, odometer_m, GatewayStamp(driver, at), NO_TERM)


def fix(at: float, pose: Pose2D = ORIGIN, *, driver: int = 1) -> Localization:
    return Localization(Header("driver", driver, 1, at), pose)


def estimator(noise: EstimatorNoise = SURE) -> Estimator:
    """One that stands at the origin of `map` and `odom` since 1 s."""
    made = Estimator(noise)
    assert made.sensors(odometry(1.0), 1.0)
    assert made.localization(fix(1.0), 1.0)
    return made


def where(known: Estimator, now: float) -> tuple[float, float, float]:
    pose = known.pose_at(now)
    assert pose is not None, known.missing(now)
    return pose[0].x, pose[0].y, pose[0].theta


@pytest.mark.parametrize(
    "refused",
    [
        odometry(2.0, Pose2D(NAN, 0.0, 0.0)),
        odometry(2.0, odometer_m=NAN),
        odometry(1.0),
        odometry(0.5),
        odometry(3600.0),
        fix(NAN),
        fix(2.0, Pose2D(0.0, NAN, 0.0)),
        fix(0.5),
    ],
)
def test_a_reading_that_is_refused_counts_once_and_changes_nothing(refused: Sensors | Localization) -> None:
    one = estimator()
    assert one.refused == 0
    taken = one.sensors(refused, 1.1) if isinstance(refused, Sensors) else one.localization(refused, 1.1)
    assert not taken
    assert one.refused == 1
    assert (one.odometer_m, one.last_fix_at) == (0.0, 1.0)
    assert one.sensors(odometry(1.1, Pose2D(0.5, 0.0, 0.0), 0.5), 1.1)
    assert where(one, 1.1) == pytest.approx((0.5, 0.0, 0.0))


def test_a_fix_ahead_of_the_odometry_waits_until_the_odometry_has_reached_it() -> None:
    one = estimator(EstimatorNoise())
    ahead = Pose2D(0.02, 0.0, 0.0)
    assert one.localization(fix(1.05, ahead), 1.0)
    assert one.last_fix_at == 1.0
    assert one.sensors(odometry(1.04), 1.04)
    assert where(one, 1.04) == (0.0, 0.0, 0.0)
    assert one.sensors(odometry(1.05), 1.05)
    corrected = where(one, 1.05)[0]
    assert corrected > 0.005
    assert one.sensors(odometry(1.06), 1.06)
    assert where(one, 1.06)[0] == corrected, "it is applied once"


def test_a_fix_heard_before_any_good_odometry_holds_for_the_first() -> None:
    one = Estimator()
    assert not one.sensors(odometry(1.0, Pose2D(NAN, 0.0, 0.0)), 1.0)
    assert one.localization(fix(1.0, Pose2D(4.0, 2.0, 1.0)), 1.0)
    assert one.missing(1.0) == "odometry"
    assert one.odometer_m == 0.0
    assert one.sensors(odometry(1.02, Pose2D(9.0, 9.0, 0.0)), 1.02)
    assert where(one, 1.02) == pytest.approx((4.0, 2.0, 1.0))


def test_a_fix_between_two_samples_is_compared_with_the_place_between_them() -> None:
    one = estimator()
    for at, x in ((1.1, 0.1), (1.3, 0.5), (1.4, 0.5)):
        assert one.sensors(odometry(at, Pose2D(x, 0.0, 0.0), x), at)
    assert one.localization(fix(1.15, Pose2D(0.2, 0.0, 0.0)), 1.4)
    assert one.outliers == 0
    assert where(one, 1.4) == pytest.approx((0.5, 0.0, 0.0))
    assert one.localization(fix(1.15, Pose2D(0.21, 0.0, 0.0)), 1.4)
    assert one.outliers == 1


@pytest.mark.parametrize(("error", "outliers"), [(0.48, 0), (0.52, 1)])
def test_up_to_a_fix_between_two_samples_the_robot_has_driven_a_part_of_the_way_between_them(
    error: float, outliers: int
) -> None:
    """3 m and half of 2 m since the last fix: five deviations of 5 cm a root of a metre are half a metre."""
    one = estimator(replace(SURE, per_metre_m=0.05))
    for at, x in ((1.1, 3.0), (1.3, 5.0)):
        one.sensors(odometry(at, Pose2D(x, 0.0, 0.0), x), at)
    one.localization(fix(1.2, Pose2D(4.0 + error, 0.0, 0.0)), 1.3)
    assert one.outliers == outliers


def test_a_robot_that_turned_under_refused_fixes_has_no_pose_once_its_heading_is_uncertain() -> None:
    """Its position may be as sure as ever: it stood."""
    one = estimator(replace(SURE, per_radian_rad=SIGMA_RAD_MAX))
    for n, known in ((1, None), (2, "localization")):
        at, turned = 1.0 + 0.1 * n, Pose2D(0.0, 0.0, 0.9 * n)
        one.sensors(odometry(at, turned), at)
        one.localization(fix(at, Pose2D(3.0, 0.0, turned.theta)), at)
        assert (one.outliers, one.missing(at)) == (n, known)


def test_a_clock_was_set_back_when_so_many_stamps_in_a_row_are_before_the_newest() -> None:
    """One that goes on from the newest in between shows that it was not."""
    one = estimator()
    late = [0.5 + 0.01 * n for n in range(BACKWARD_TO_RESTART - 1)]
    for newest in (1.1, 1.2):
        assert [one.sensors(odometry(at), 1.05) for at in late] == [False] * len(late)
        assert one.sensors(odometry(newest), newest)
    assert [one.sensors(odometry(at), 1.25) for at in late] == [False] * len(late)
    assert one.missing(1.25) is None
    assert one.sensors(odometry(0.6), 1.25)
    assert one.missing(1.25) == "localization"
    assert [one.sensors(odometry(0.5), 1.26) for _ in late] == [False] * len(late), "from then on it counts anew"


def test_a_turn_on_the_spot_counts_as_way_driven_without_a_fix() -> None:
    one = estimator()
    for n in range(1, 11):
        assert not one.unfixed
        one.sensors(odometry(1.0 + 0.02 * n, Pose2D(0.0, 0.0, 0.26 * n)), 1.0 + 0.02 * n)
    assert one.unfixed, "0.3 m a radian, and 2.6 rad"


def test_way_driven_backwards_counts_as_way_driven_forwards() -> None:
    one = estimator()
    for n, odometer_m in enumerate((0.5, 0.0, 0.5, 0.0), 1):
        one.sensors(odometry(1.0 + 0.02 * n, odometer_m=odometer_m), 1.0 + 0.02 * n)
    assert one.odometer_m == 0.0
    assert one.missing(1.08) == "localization", f"2 m are more than {UNFIXED_M_MAX} m"


def test_a_good_fix_makes_an_end_of_the_way_without_one() -> None:
    one = estimator()
    for n in range(1, 7):
        at, x = 1.0 + 0.1 * n, 0.5 * n
        one.sensors(odometry(at, Pose2D(x, 0.0, 0.0), x), at)
        one.localization(fix(at, Pose2D(x, 0.0, 0.0)), at)
        assert not one.unfixed
        assert one.missing(at) is None


def test_the_odometers_reading_is_that_of_the_newest_odometry() -> None:
    one = estimator()
    for n in range(1, 5):
        one.sensors(odometry(1.0 + 0.02 * n, Pose2D(n, 0.0, 0.0), float(n)), 1.0 + 0.02 * n)
        assert one.odometer_m == n


@pytest.mark.parametrize("ahead_s", [100.0, -100.0])
def test_the_age_of_odometry_is_told_on_the_own_clock(ahead_s: float) -> None:
    one = Estimator()
    assert one.age_s(5.0) == float("inf")
    one.sensors(odometry(200.0 + ahead_s), 200.0)
    one.localization(fix(200.0 + ahead_s), 200.0)
    assert one.age_s(200.0 + ODOMETRY_S_MAX) == pytest.approx(ODOMETRY_S_MAX)
    assert one.missing(200.0 + 0.9 * ODOMETRY_S_MAX) is None
    assert one.missing(200.0 + 1.1 * ODOMETRY_S_MAX) == "odometry"


def test_a_new_driver_takes_nothing_over_from_the_last_one() -> None:
    """Its clock begins anew, and with it the order of its stamps; a fix of the last one is none for it."""
    one = estimator()
    assert one.localization(fix(1.5, Pose2D(7.0, 7.0, 0.0)), 1.1), "waits for odometry of 1.5 s"
    for _ in range(4):
        one.localization(fix(1.0, Pose2D(3.0, 0.0, 0.0)), 1.1)
    assert one.outliers == 4
    assert one.sensors(odometry(0.2, driver=2), 1.2)
    assert one.sensors(odometry(1.6, driver=2), 2.6)
    assert one.missing(2.6) == "localization"
    assert one.localization(fix(1.6, Pose2D(1.0, 0.0, 0.0), driver=2), 2.6)
    assert where(one, 2.6) == pytest.approx((1.0, 0.0, 0.0))
    one.localization(fix(1.6, Pose2D(3.0, 0.0, 0.0), driver=2), 2.6)
    assert one.relocations == 0, "four outliers of the last driver and one of this"


def said(one: Estimator, *fixes: Pose2D) -> None:
    """Localisation beside standing wheels."""
    for pose in fixes:
        one.localization(fix(1.0, pose), 1.1)


CARRIED = Pose2D(3.0, 0.0, 0.0)


def test_four_fixes_that_agree_are_outliers_and_the_fifth_is_where_the_robot_is() -> None:
    one = estimator()
    said(one, *[CARRIED] * (OUTLIERS_TO_RELOCATE - 1))
    assert (one.outliers, one.relocations) == (4, 0)
    assert where(one, 1.1) == pytest.approx((0.0, 0.0, 0.0))
    said(one, CARRIED)
    assert (one.outliers, one.relocations) == (5, 1)
    assert where(one, 1.1) == pytest.approx((3.0, 0.0, 0.0))


def test_a_fix_that_agrees_with_the_odometry_begins_the_count_of_outliers_anew() -> None:
    one = estimator()
    said(one, *[CARRIED] * 4, Pose2D(), *[CARRIED] * 4)
    assert one.relocations == 0
    said(one, CARRIED)
    assert one.relocations == 1


def test_a_robot_that_was_found_again_has_to_be_lost_by_five_more() -> None:
    one = estimator()
    said(one, *[CARRIED] * 5, *[Pose2D()] * 4)
    assert one.relocations == 1
    said(one, Pose2D())
    assert one.relocations == 2


@pytest.mark.parametrize(
    ("step", "agrees"),
    [
        (Pose2D(0.52, 0.0, 0.0), True),
        (Pose2D(0.0, -0.52, 0.0), True),
        (Pose2D(0.3, 0.3, 0.0), False),
        (Pose2D(-0.56, 0.0, 0.0), False),
        (Pose2D(0.0, 0.56, 0.0), False),
        (Pose2D(0.0, 0.0, 0.49), True),
        (Pose2D(0.0, 0.0, -0.51), False),
    ],
)
def test_outliers_agree_within_half_a_metre_and_half_a_radian(step: Pose2D, agrees: bool) -> None:
    one = estimator(EstimatorNoise())
    said(one, *[CARRIED] * 3)
    after = Pose2D(CARRIED.x + step.x, step.y, step.theta)
    said(one, after, after)
    assert one.relocations == int(agrees)
    said(one, after, after)
    assert one.relocations == int(agrees)
    said(one, after)
    assert one.relocations == 1


DRIVEN = {
    "per_metre_m": (0.05, 4.0, 0.0, 0.0, 0.1),
    "per_second_m": (0.01, 0.0, 0.0, 100.0, 0.1),
    "per_metre_rad": (0.02, 4.0, 0.0, 0.0, 0.04),
    "per_radian_rad": (0.1, 0.0, 1.0, 0.0, 0.1),
    "per_second_rad": (0.01, 0.0, 0.0, 100.0, 0.1),
}
"""Part of the noise: its value; way [m], turn [rad], time [s] since the last fix; the deviation [m, rad] by then."""


@pytest.mark.parametrize("part", DRIVEN)
def test_the_gate_opens_with_the_way_the_turn_and_the_time_since_the_last_fix(part: str) -> None:
    """A fix is admitted up to five standard deviations of what may have come since the last one, and no farther."""
    value, way_m, turn, lasted_s, deviation = DRIVEN[part]
    for error, outliers in ((4.5 * deviation, 0), (5.5 * deviation, 1)):
        one = estimator(replace(SURE, **{part: value}))
        at, there = 1.02 + lasted_s, Pose2D(way_m, 0.0, turn)
        one.sensors(odometry(at, there, way_m), at)
        along, turned = (0.0, error) if part.endswith("rad") else (error, 0.0)
        one.localization(fix(at, Pose2D(way_m + along, 0.0, turn + turned)), at)
        assert one.outliers == outliers


def test_a_heading_error_is_a_lateral_error_after_the_next_way() -> None:
    """A fix that is beside the way by what the heading may be wrong corrects the heading, too."""
    one = estimator(replace(SURE, fix_rad=0.01))
    one.sensors(odometry(1.02, Pose2D(1.0, 0.0, 0.0), 1.0), 1.02)
    one.localization(fix(1.02, Pose2D(1.0, 0.01, 0.0)), 1.02)
    assert one.outliers == 0
    x, y, theta = where(one, 1.02)
    assert (x, y) == pytest.approx((1.0, 0.01), abs=1e-6)
    assert theta == pytest.approx(0.01, rel=0.01)


def test_a_robot_found_again_is_as_uncertain_as_its_fix() -> None:
    """What it had grown to before does not count any more."""
    one = estimator(replace(SURE, fix_m=1e-3, per_metre_m=0.1))
    one.sensors(odometry(1.02, Pose2D(1.0, 0.0, 0.0), 1.0), 1.02)
    away = Pose2D(5.0, 5.0, pi / 2.0)
    for _ in range(OUTLIERS_TO_RELOCATE):
        one.localization(fix(1.02, away), 1.02)
    assert one.relocations == 1
    one.localization(fix(1.02, Pose2D(5.05, 5.0, pi / 2.0)), 1.02)
    assert one.outliers == OUTLIERS_TO_RELOCATE + 1


@pytest.mark.parametrize(
    ("step", "jumps"),
    [
        (Pose2D(0.07, 0.0, 0.0), 0),
        (Pose2D(0.06, -0.06, 0.0), 1),
        (Pose2D(0.0, 0.0, 0.03), 0),
        (Pose2D(0.0, 0.0, -0.04), 1),
    ],
)
def test_a_correction_of_the_pose_by_more_than_noise_is_a_jump(step: Pose2D, jumps: int) -> None:
    """A fix that is as sure as the pose moves it half of the way."""
    one = estimator(replace(SURE, fix_m=0.05, fix_rad=0.05))
    said(one, step)
    assert one.jumps == jumps


def test_a_robot_that_is_found_elsewhere_has_jumped() -> None:
    one = estimator()
    said(one, *[CARRIED] * 4)
    assert one.jumps == 0
    said(one, CARRIED)
    assert one.jumps == 1
