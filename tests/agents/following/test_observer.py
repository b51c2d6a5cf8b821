"""Both forms of the observer against control.md section 3."""

from __future__ import annotations

from math import cos, exp, hypot, sin
from random import Random

import pytest

from lfa.agents.following.observer import IMAGINARY, REAL, L, Observer, SlotVelocityObserver
from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc, wrap


def test_the_matrix_of_the_paper_has_the_poles_that_form_B_is_given() -> None:
    """3.1: trace 13, determinant 107.4, eigenvalues 6.5 +- 8.07i, symmetric part positive."""
    (a, b), (c, d) = L
    assert a + d == pytest.approx(2.0 * REAL)
    assert a * d - b * c == pytest.approx(REAL**2 + IMAGINARY**2)
    half = 0.5 * (b + c)
    assert 0.5 * (a + d) - hypot(0.5 * (a - d), half) == pytest.approx(2.63, abs=0.01)


@pytest.mark.parametrize("h", [0.01, 0.02, 0.05, 0.2])
def test_the_error_of_form_B_shrinks_by_the_papers_poles_at_any_interval(h: float) -> None:
    """3.3: two updates apart, x[n+2] - 2 e^{-6.5h} cos(8.07h) x[n+1] + e^{-13h} x[n] = 0."""
    observer = Observer("pose")
    observer.heard(0.0, Pose2D(), STILL)
    observer.heard(h, Pose2D(0.01, 0.0, 0.0), STILL)
    errors = []
    for n in range(2, 8):
        before, _, _ = observer.at(n * h)
        errors.append(0.01 - before.x)
        observer.heard(n * h, Pose2D(0.01, 0.0, 0.0), STILL)
    decay = exp(-REAL * h)
    for a, b, c in zip(errors, errors[1:], errors[2:], strict=False):
        assert c - 2.0 * decay * cos(IMAGINARY * h) * b + decay**2 * a == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("h", [0.01, 0.02, 0.05])
def test_a_speed_step_settles_within_0_56_s_and_overshoots_8_percent(h: float) -> None:
    observer = Observer("pose")
    speeds = []
    for n in range(int(1.5 / h)):
        observer.heard(n * h, Pose2D(0.5 * n * h, 0.0, 0.0), STILL)
        speeds.append(observer.at(n * h)[1].linear_x)
    outside = [n * h for n, v in enumerate(speeds) if abs(v - 0.5) > 0.01]
    assert max(outside) <= 0.58
    assert 1.05 < max(speeds) / 0.5 < 1.10


def test_pose_only_finds_velocity_and_turn_rate_of_an_arc_under_any_loss() -> None:
    observer, chance = Observer("pose"), Random(3)
    twist = Twist(0.5, 0.4)
    for n in range(400):
        if chance.random() > 0.4:
            observer.heard(n * 0.02, along_arc(Pose2D(), twist, n * 0.02), STILL)
    pose, seen, _ = observer.at(8.0)
    true = along_arc(Pose2D(), twist, 8.0)
    assert (seen.linear_x, seen.angular_z) == pytest.approx((0.5, 0.4), abs=1e-3)
    assert hypot(pose.x - true.x, pose.y - true.y) < 1e-3


def test_with_velocity_dead_reckoning_is_exact_on_an_arc_and_bounded_in_time() -> None:
    observer = Observer("velocity", extrapolation_max_s=0.5)
    twist = Twist(0.5, 0.4)
    observer.heard(10.0, Pose2D(1.0, 2.0, 0.3), twist)
    pose, _, age = observer.at(10.4)
    true = along_arc(Pose2D(1.0, 2.0, 0.3), twist, 0.4)
    assert (pose.x, pose.y, pose.theta) == pytest.approx((true.x, true.y, true.theta), abs=1e-12)
    assert age == pytest.approx(0.4)
    assert observer.at(13.0)[0] == observer.at(10.5)[0]
    assert observer.at(13.0)[2] == pytest.approx(3.0)


@pytest.mark.parametrize("mode", ["velocity", "pose"])
def test_one_outlier_is_dropped_and_two_in_a_row_are_a_jump(mode: str) -> None:
    observer = Observer(mode)  # type: ignore[arg-type]
    for n in range(50):
        observer.heard(n * 0.02, Pose2D(0.01 * n, 0.0, 0.0), Twist(0.5, 0.0))
    assert not observer.heard(1.0, Pose2D(5.0, 5.0, 0.0), Twist(0.5, 0.0))
    assert abs(observer.at(1.0)[0].x - 0.5) < 0.02
    assert observer.heard(1.02, Pose2D(0.51, 0.0, 0.0), Twist(0.5, 0.0))
    assert observer.jumps == 0
    assert not observer.heard(1.04, Pose2D(5.0, 5.0, 1.0), STILL)
    assert observer.heard(1.06, Pose2D(5.0, 5.0, 1.0), STILL)
    assert observer.jumps == 1
    assert observer.at(1.06)[0] == Pose2D(5.0, 5.0, 1.0)


def test_late_repeated_and_absurd_messages_change_nothing() -> None:
    observer = Observer("velocity")
    observer.heard(1.0, Pose2D(1.0, 0.0, 0.0), Twist(0.5, 0.0))
    nan, inf = float("nan"), float("inf")
    for stamp, pose, twist in (
        (1.0, Pose2D(2.0, 0.0, 0.0), STILL),
        (0.5, Pose2D(), STILL),
        (nan, Pose2D(), STILL),
        (inf, Pose2D(), STILL),
        (1.1, Pose2D(nan, 0.0, 0.0), STILL),
        (1.1, Pose2D(0.0, 0.0, inf), STILL),
        (1.1, Pose2D(1e9, 0.0, 0.0), STILL),
        (1.1, Pose2D(), Twist(nan, 0.0)),
        (1.1, Pose2D(), Twist(0.0, 1e4)),
    ):
        assert not observer.heard(stamp, pose, twist)
    assert observer.refused == 9
    assert observer.at(1.0) == (Pose2D(1.0, 0.0, 0.0), Twist(0.5, 0.0), 0.0)


@pytest.mark.parametrize("own", [STILL, Twist(0.3, 0.0), Twist(0.4, 0.8)])
def test_form_A_finds_a_constant_slot_velocity_without_bias_while_the_follower_turns(own: Twist) -> None:
    """3.2: the slot's velocity as unknown input; zero bias for every own turn rate."""
    observer, h, w = SlotVelocityObserver(), 0.02, (0.5, -0.1)
    pose = Pose2D()
    seen = (0.0, 0.0)
    for n in range(200):
        x, y = 1.0 + w[0] * n * h - pose.x, w[1] * n * h - pose.y
        c, s = cos(pose.theta), sin(pose.theta)
        seen = observer.step((c * x + s * y, c * y - s * x), own if n else STILL, h)
        pose = along_arc(pose, own, h)
    theta = wrap(pose.theta - own.angular_z * h)
    c, s = cos(theta), sin(theta)
    # Constant in the map is turning in the follower's frame, which the observer lags by about |omega| / 6.5.
    tolerance = 1e-6 + 0.12 * abs(own.angular_z)
    assert seen == pytest.approx((c * w[0] + s * w[1], c * w[1] - s * w[0]), abs=tolerance)


@pytest.mark.parametrize("h", [0.01, 0.02, 0.05])
def test_form_A_settles_in_0_64_s_whatever_the_interval(h: float) -> None:
    observer = SlotVelocityObserver()
    outside = 0.0
    peak = 0.0
    for n in range(int(1.5 / h)):
        wx, _ = observer.step((0.5 * n * h, 0.0), STILL, h)
        peak = max(peak, wx)
        if abs(wx - 0.5) > 0.01:
            outside = n * h
    assert outside <= 0.66
    assert peak / 0.5 == pytest.approx(1.084, abs=0.02)
