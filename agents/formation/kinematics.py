"""Corrected model of control.md section 1: slot, look-ahead error and its dynamics, by the paper's equation numbers.

phi is the bearing of the slot in the predecessor's frame. In this convention the printed (28) has the wrong sign at its
k omega term, and the printed (29) at its v sin(gamma) term: a controller built on it does not converge.
"""

from __future__ import annotations

from math import atan2, cos, sin

from lfa.protocol.geometry import Pose2D, Twist, wrap


def slot(predecessor: Pose2D, k: float, phi: float) -> tuple[float, float]:
    """Return the slot r = p_P + k e(theta_P + phi) [m], in the frame of `predecessor`."""
    return predecessor.x + k * cos(predecessor.theta + phi), predecessor.y + k * sin(predecessor.theta + phi)


def slot_velocity(theta: float, v: float, turn_rate: float, dx: float, dy: float) -> tuple[float, float]:
    """Return the velocity [m/s] of the point at (dx, dy) from a predecessor with heading `theta`, speed `v` (eq. 21,
    22).

    (dx, dy) = k e(chi + phi) turns with the formation at `turn_rate`, so this is v e(theta) + k chi' e_perp(chi + phi).
    """
    return v * cos(theta) - turn_rate * dy, v * sin(theta) + turn_rate * dx


def look_ahead_error(own: Pose2D, x: float, y: float, b: float) -> tuple[float, float]:
    """Return the point (x, y) relative to the look-ahead point, in the follower's axes [m] (eq. 27 with -b)."""
    c, s = cos(own.theta), sin(own.theta)
    dx, dy = x - own.x, y - own.y
    return c * dx + s * dy - b, c * dy - s * dx


def error_rates(
    error: tuple[float, float], gamma: float, predecessor: Twist, own: Twist, k: float, phi: float, b: float
) -> tuple[float, float]:
    """Return the rates of the look-ahead error [m/s], with gamma = theta_P - theta_F (eq. 28 to 31, corrected)."""
    x_e, y_e = error
    v, omega = predecessor.linear_x, predecessor.angular_z
    v_f, omega_f = own.linear_x, own.angular_z
    return (
        -v_f + v * cos(gamma) - k * omega * sin(phi + gamma) + omega_f * y_e,
        -b * omega_f + v * sin(gamma) + k * omega * cos(phi + gamma) - omega_f * x_e,
    )


def feasible_heading(predecessor: Pose2D, twist: Twist, k: float, phi: float) -> float:
    """Return psi_r = theta_P + beta, the only heading that a unicycle in the slot can have (control.md 1)."""
    dx, dy = k * cos(predecessor.theta + phi), k * sin(predecessor.theta + phi)
    vx, vy = slot_velocity(predecessor.theta, twist.linear_x, twist.angular_z, dx, dy)
    return wrap(atan2(vy, vx))
