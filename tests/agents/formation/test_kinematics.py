"""The corrected equations of control.md section 1 against finite differences of simulated motion."""

from __future__ import annotations

from math import atan2, cos, hypot, pi, sin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lfa.agents.formation.kinematics import error_rates, feasible_heading, look_ahead_error, slot, slot_velocity
from lfa.protocol.geometry import Pose2D, Twist, along_arc, wrap

K, B = 1.2, 0.3
H = 1e-5
angles = st.floats(-pi, pi)
poses = st.builds(Pose2D, st.floats(-5, 5), st.floats(-5, 5), angles)
twists = st.builds(Twist, st.floats(-0.5, 1.0), st.floats(-1.5, 1.5))


def _ahead(own: Pose2D) -> tuple[float, float]:
    return own.x + B * cos(own.theta), own.y + B * sin(own.theta)


@settings(max_examples=10)
@given(poses, twists)
def test_eq_1_arc_is_what_many_small_euler_steps_tend_to(pose: Pose2D, twist: Twist) -> None:
    x, y, theta, n = pose.x, pose.y, pose.theta, 20_000
    for _ in range(n):
        theta += 0.5 * twist.angular_z / n
        x += twist.linear_x * cos(theta) / n
        y += twist.linear_x * sin(theta) / n
        theta += 0.5 * twist.angular_z / n
    end = along_arc(pose, twist, 1.0)
    assert hypot(end.x - x, end.y - y) < 1e-8
    assert abs(wrap(end.theta - theta)) < 1e-8


@given(poses, twists, angles)
def test_eq_21_22_slot_velocity_is_the_derivative_of_the_slot(pose: Pose2D, twist: Twist, phi: float) -> None:
    x0, y0 = slot(along_arc(pose, twist, -H), K, phi)
    x1, y1 = slot(along_arc(pose, twist, H), K, phi)
    side = pose.theta + phi
    vx, vy = slot_velocity(pose.theta, twist.linear_x, twist.angular_z, K * cos(side), K * sin(side))
    assert vx == pytest.approx((x1 - x0) / (2 * H), abs=1e-6)
    assert vy == pytest.approx((y1 - y0) / (2 * H), abs=1e-6)


@given(poses, twists)
def test_eq_24_25_look_ahead_point_is_ahead_and_moves_with_minus_h_omega_sin(own: Pose2D, twist: Twist) -> None:
    x0, y0 = _ahead(along_arc(own, twist, -H))
    x1, y1 = _ahead(along_arc(own, twist, H))
    v, omega, theta = twist.linear_x, twist.angular_z, own.theta
    assert v * cos(theta) - B * omega * sin(theta) == pytest.approx((x1 - x0) / (2 * H), abs=1e-6)
    assert v * sin(theta) + B * omega * cos(theta) == pytest.approx((y1 - y0) / (2 * H), abs=1e-6)


@given(poses, poses)
def test_eq_27_with_minus_b_is_zero_exactly_at_the_look_ahead_point(own: Pose2D, other: Pose2D) -> None:
    assert look_ahead_error(own, *_ahead(own), B) == pytest.approx((0.0, 0.0), abs=1e-12)
    x_e, y_e = look_ahead_error(own, other.x, other.y, B)
    ahead_x, ahead_y = _ahead(own)
    assert hypot(x_e, y_e) == pytest.approx(hypot(other.x - ahead_x, other.y - ahead_y), abs=1e-9)


@given(poses, twists, poses, twists, angles)
def test_eq_28_to_31_error_rates_are_the_derivatives_of_the_error(
    leader: Pose2D, leader_twist: Twist, own: Pose2D, own_twist: Twist, phi: float
) -> None:
    def error(t: float) -> tuple[float, float]:
        return look_ahead_error(along_arc(own, own_twist, t), *slot(along_arc(leader, leader_twist, t), K, phi), B)

    before, after = error(-H), error(H)
    rates = error_rates(error(0.0), leader.theta - own.theta, leader_twist, own_twist, K, phi, B)
    for rate, a, b in zip(rates, before, after, strict=True):
        assert rate == pytest.approx((b - a) / (2 * H), abs=1e-5)


def test_feasible_heading_differs_from_the_predecessors_on_a_curve_by_beta() -> None:
    """Section 1: tan beta = k kappa cos(phi) / (1 - k kappa sin(phi)), so (17) and (20) cannot go to zero."""
    curvature, phi = 0.25, 2 * pi / 3
    beta = atan2(K * curvature * cos(phi), 1.0 - K * curvature * sin(phi))
    heading = feasible_heading(Pose2D(1.0, 2.0, 0.7), Twist(0.5, 0.5 * curvature), K, phi)
    assert wrap(heading - 0.7) == pytest.approx(beta, abs=1e-12)
    assert abs(beta) > 0.15


def _look_ahead_error_rms(printed_29: bool, radius_m: float | None) -> float:
    """Second half of 40 s under the linearising law that inverts (28) and (29) for e' = -K e."""
    gain, dt, phi = 1.5, 0.005, 2 * pi / 3
    leader = Pose2D()
    twist = Twist(0.5, 0.0 if radius_m is None else 0.5 / radius_m)
    own = Pose2D(*slot(leader, K, phi), 0.1)
    squares = []
    for step in range(8000):
        gamma = leader.theta - own.theta
        x_e, y_e = look_ahead_error(own, *slot(leader, K, phi), B)
        drift_x, drift_y = error_rates((x_e, y_e), gamma, twist, Twist(), K, phi, B)
        if printed_29:
            drift_y -= 2.0 * twist.linear_x * sin(gamma)
        command = Twist(drift_x + gain * x_e, (drift_y + gain * y_e) / B)
        if step >= 4000:
            squares.append(x_e * x_e + y_e * y_e)
        leader, own = along_arc(leader, twist, dt), along_arc(own, command, dt)
    return (sum(squares) / len(squares)) ** 0.5


@pytest.mark.parametrize("radius_m", [None, 4.0])
def test_the_printed_29_does_not_converge_and_the_corrected_one_does(radius_m: float | None) -> None:
    """Do not repair error_rates back to the print: -v_L sin(gamma) in (29) drives the robot out of its slot."""
    assert _look_ahead_error_rms(False, radius_m) < 2e-3
    assert _look_ahead_error_rms(True, radius_m) > 0.04
