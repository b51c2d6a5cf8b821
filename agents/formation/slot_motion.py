"""The moving slot of a follower: the law's steps 2 and 3.

A change of (k, phi) is blended in polar form through the rear; a change of the slot's reference (another predecessor, a
trace, a rejoin) by a shrinking offset: the target never jumps.
"""

from __future__ import annotations

from math import cos, hypot, pi, sin, sqrt

from lfa.agents.config import Gains
from lfa.agents.formation.kinematics import slot_velocity
from lfa.agents.formation.pose_history import PoseHistory
from lfa.protocol.geometry import TAU, Pose2D, Twist, bearing, wrap
from lfa.protocol.messages.team import Slot
from lfa.protocol.mission import Limits

BLEND_SHARE_MIN = 0.1
"""Minimum rate of a blend, as a share of its rate limit, however fast the predecessor drives."""
OFFSET_PER_S, OFFSET_LAST_MPS = 2.0, 0.01
"""Rate of the offset's last part, as a share of the offset [1/s] plus a minimum [m/s]. It is slow, because a robot that
enters its slot at an angle swings past a slot that comes to rest at once."""


class SlotMotion:
    """Moving slot (steps 2 and 3 of the law): chi, the blended (k, phi) and the offset o yield r and its velocity.

    After `step` the attributes x, y [m], vx, vy [m/s] (in `map`), chi, chi_rate, separation_m and phi are valid.
    """

    __slots__ = (
        "_gains", "_limit_mps", "chi", "chi_rate", "heading_filter_m", "lead_m", "offset_x", "offset_y", "phi",
        "separation_m", "settled", "vx", "vy", "x", "y",
    )  # fmt: skip

    def __init__(self, gains: Gains, limits: Limits, heading_filter_m: float) -> None:
        self._gains = gains
        self._limit_mps = gains.slot_speed_share * limits.v_max_mps
        self.heading_filter_m = heading_filter_m
        self.lead_m = 0.0
        """Forward shift [m] of the slot along chi that compensates a reference known to be old (5.2)."""
        self.separation_m = 0.0
        self.phi = pi
        self.chi = 0.0
        self.chi_rate = 0.0
        self.offset_x = self.offset_y = 0.0
        self.x = self.y = self.vx = self.vy = 0.0
        self.settled = True

    def reset(self, slot: Slot, predecessor: Pose2D) -> None:
        """Start in the commanded slot, without blends."""
        self.separation_m, self.phi = slot.separation_m, slot.phi % TAU
        self.chi, self.chi_rate = predecessor.theta, 0.0
        self.offset_x = self.offset_y = 0.0

    def hang_at(self, x: float, y: float) -> None:
        """Keep the target at (x, y), right after a step, and let the offset shrink from there."""
        self.offset_x += x - self.x
        self.offset_y += y - self.y
        self.x, self.y = x, y

    def step(self, slot: Slot, predecessor: Pose2D, twist: Twist, dt: float) -> None:
        """Advance by `dt` towards the commanded `slot`; `predecessor` is its pose at the end of that time."""
        theta, v = predecessor.theta, twist.linear_x
        if self.heading_filter_m > 0.0:
            self.chi = wrap(self.chi + self.chi_rate * dt)
            limit = self._gains.chi_rate_max_radps
            rate = abs(v) / self.heading_filter_m * wrap(theta - self.chi)
            self.chi_rate = limit if rate > limit else -limit if rate < -limit else rate
        else:
            self.chi, self.chi_rate = theta, twist.angular_z
        angle = self.chi + self.phi
        c, s = cos(angle), sin(angle)
        k = self.separation_m
        behind_x, behind_y = k * c, k * s
        if self.lead_m != 0.0:
            behind_x += self.lead_m * cos(self.chi)
            behind_y += self.lead_m * sin(self.chi)
        self.vx, self.vy = slot_velocity(theta, v, self.chi_rate, behind_x, behind_y)
        self.x = predecessor.x + behind_x + self.offset_x
        self.y = predecessor.y + behind_y + self.offset_y
        self.settled = self._blend(slot, c, s, dt)

    def step_on(
        self, trace: PoseHistory, travelled_m: float, slot: Slot, predecessor: Pose2D, v: float, dt: float
    ) -> None:
        """Advance by `dt` on the predecessor's trace, `slot.separation_m` of path behind it (5.5)."""
        point = trace.at(travelled_m - self.separation_m + self.lead_m)
        c, s = cos(point.theta), sin(point.theta)
        self.vx, self.vy = v * c, v * s
        self.x, self.y = point.x + self.offset_x, point.y + self.offset_y
        self.chi, self.phi = bearing(Pose2D(point.x, point.y), predecessor), pi
        self.chi_rate = point.curvature * v
        self.settled = self._blend(Slot(slot.robot, slot.separation_m, pi), -c, -s, dt)

    def _blend(self, slot: Slot, c: float, s: float, dt: float) -> bool:
        """Move (k, phi) and the offset towards their targets; return True when they are reached."""
        dk = slot.separation_m - self.separation_m
        dphi = slot.phi % TAU - self.phi
        ox, oy = self.offset_x, self.offset_y
        if dk == 0.0 and dphi == 0.0 and ox == 0.0 and oy == 0.0:
            return True
        gains = self._gains
        k_rate = _towards(dk, gains.separation_rate_max_mps, dt)
        phi_rate = _towards(dphi, gains.phi_rate_max_radps, dt)
        o = hypot(ox, oy)
        o_rate = _towards(-o, min(gains.offset_rate_max_mps, OFFSET_PER_S * o + OFFSET_LAST_MPS), dt)
        o_vx, o_vy = (o_rate * ox / o, o_rate * oy / o) if o > 0.0 else (0.0, 0.0)
        bx = k_rate * c - self.separation_m * phi_rate * s + o_vx
        by = k_rate * s + self.separation_m * phi_rate * c + o_vy
        share = max(BLEND_SHARE_MIN, _share(self.vx, self.vy, bx, by, self._limit_mps))
        self.vx += share * bx
        self.vy += share * by
        step = share * dt
        self.separation_m = _approach(self.separation_m, k_rate * step, slot.separation_m)
        self.phi = _approach(self.phi, phi_rate * step, slot.phi % TAU)
        self.offset_x = _approach(ox, o_vx * step, 0.0)
        self.offset_y = _approach(oy, o_vy * step, 0.0)
        return False


def _towards(rest: float, rate_max: float, dt: float) -> float:
    """Return the rate that removes `rest`, at most `rate_max`, without overshoot within `dt`."""
    rate = rest / dt
    return rate_max if rate > rate_max else -rate_max if rate < -rate_max else rate


def _approach(value: float, step: float, target: float) -> float:
    """Return `value` + `step`, or exactly `target` when they agree within numerical precision."""
    moved = value + step
    return target if abs(target - moved) < 1e-9 else moved


def _share(ax: float, ay: float, bx: float, by: float, limit: float) -> float:
    """Return the largest s in [0, 1] with |a + s b| <= limit; 0 when |a| alone exceeds it."""
    if hypot(ax + bx, ay + by) <= limit:
        return 1.0
    rest = limit * limit - ax * ax - ay * ay
    if rest <= 0.0:
        return 0.0
    bb, ab = bx * bx + by * by, ax * bx + ay * by
    return min(1.0, (-ab + sqrt(ab * ab + bb * rest)) / bb)
