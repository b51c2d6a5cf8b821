"""Kanayama's tracker (1990) on the slot: v = v_r cos th_e + K_x x_e, omega = w_r + v_r (K_y y_e + K_th sin th_e).

Needs a moving reference and its turn rate, which is computed from the slot's heading of two successive steps.
"""

from __future__ import annotations

from math import cos, sin

from msgspec import Struct

from lfa.agents.config import Gains
from lfa.agents.following.controller import Reference, guard
from lfa.protocol.geometry import Pose2D, Twist, wrap
from lfa.protocol.mission import Limits


class KanayamaParameters(Struct, frozen=True, forbid_unknown_fields=True):
    """Gains, by default with critically damped lateral motion: K_theta^2 >= 4 K_y / 1.5."""

    kx_per_s: float = 1.5
    ky_per_m2: float = 6.0
    ktheta_per_m: float = 4.0


class Kanayama:
    Parameters = KanayamaParameters

    def __init__(self, gains: Gains, limits: Limits, parameters: KanayamaParameters) -> None:
        self._k = parameters
        self._gains = gains
        self._omega_max = limits.omega_max_radps
        self._heading: float | None = None

    def reset(self, own_pose: Pose2D, own_twist: Twist) -> None:
        self._heading = None

    def step(self, reference: Reference, own_pose: Pose2D, own_twist: Twist, dt: float) -> Twist:
        before, self._heading = self._heading, reference.heading
        turn = 0.0 if before is None else wrap(reference.heading - before) / dt
        limit = self._omega_max
        turn = limit if turn > limit else -limit if turn < -limit else turn
        theta = own_pose.theta
        c, s = cos(theta), sin(theta)
        dx, dy = reference.x - own_pose.x, reference.y - own_pose.y
        x_e, y_e, theta_e = c * dx + s * dy, c * dy - s * dx, wrap(reference.heading - theta)
        v_r = reference.direction * reference.speed
        pull, bound = self._k.kx_per_s * x_e, self._gains.m_mps
        pull = bound if pull > bound else -bound if pull < -bound else pull
        v = v_r * cos(theta_e) + pull
        if reference.guarded:
            ux, uy = guard(v * c, v * s, reference, own_pose, self._gains)
            v = c * ux + s * uy
        return Twist(v, turn + v_r * self._k.ky_per_m2 * y_e + abs(v_r) * self._k.ktheta_per_m * sin(theta_e))
