"""Gains and bounds of the follower, with units, and the rules that they must satisfy (control.md sections 2 and 2.1).

`DEFAULT` satisfies all of them. `SHARP` recovers faster and saturates the drive: for noise-free simulation only.
"""

from __future__ import annotations

from math import inf, isfinite

from msgspec import Struct

from lfa.protocol.errors import Refused
from lfa.protocol.mission import CONTROL_HZ, Limits

CONTROL_PERIOD_S = 1.0 / CONTROL_HZ


class Gains(Struct, frozen=True, forbid_unknown_fields=True, gc=False):
    """Gains of the law (control.md section 2). Names in brackets are the derivation's."""

    k_per_s: float = 1.5
    """[K] Feedback gain of the look-ahead error."""
    b_m: float = 0.30
    """[b] Distance of the look-ahead point ahead of the centre."""
    m_mps: float = 0.5
    """[m] Maximum feedback speed."""
    lambda_psi_per_s: float = 8.0
    """[lambda_psi] Rate at which the desired heading follows the slot's direction of motion."""
    feed_forward: float = 1.0
    """[a] Share of the slot's velocity that is fed forward."""
    chi_rate_max_radps: float = 0.4
    """Maximum rate of the filtered formation heading."""
    phi_rate_max_radps: float = 0.35
    """Maximum rate at which a slot swings around the predecessor when the commanded phi changes."""
    separation_rate_max_mps: float = 0.3
    """Maximum rate of the commanded separation."""
    offset_rate_max_mps: float = 0.3
    """Maximum rate at which the gap between an old and a new slot closes after a change of predecessor."""
    slot_speed_share: float = 0.9
    """Share of v_max that the speed of a swinging slot never exceeds."""
    d_min_m: float = 0.45
    """Minimum distance between centres that the collision guard keeps."""
    guard_per_s: float = 2.0
    """Closing speed that the collision guard allows for each metre above `d_min_m`."""
    dead_reckoning_max_s: float = 0.5
    """[T_dr] Age beyond which a predecessor state is not extrapolated: the follower brakes along the path and holds."""


DEFAULT = Gains()
SHARP = Gains(k_per_s=2.0, b_m=0.2, m_mps=0.7)


def check_gains(gains: Gains, limits: Limits, dt: float = CONTROL_PERIOD_S, *, allow_saturation: bool = False) -> Gains:
    """Return `gains`; raise `Refused` with the first rule that they break.

    `allow_saturation` (simulation only) accepts gains that demand more acceleration than the drive has.
    """
    for field in gains.__struct_fields__:
        value = getattr(gains, field)
        low = 0.0 if field == "feed_forward" else 1e-6
        if not (isfinite(value) and low <= value < inf):
            raise Refused(f"gains.{field} = {value}: must be a finite number above 0")
    rate = gains.k_per_s * dt
    if rate >= 1.0:
        raise Refused(f"gains.k_per_s = {gains.k_per_s:g}: K dt = {rate:g} must be below 1 (dt = {dt:g} s)")
    if gains.lambda_psi_per_s * dt >= 1.0:
        right = f"must be below {1.0 / dt:g} 1/s (one control period)"
        raise Refused(f"gains.lambda_psi_per_s = {gains.lambda_psi_per_s:g}: {right}")
    if allow_saturation:
        return gains
    linear = gains.k_per_s * gains.m_mps
    angular = linear / gains.b_m
    for product, name, value, bound in (
        (linear, "K m", "a_max", limits.a_max_mps2),
        (angular, "K m / b", "alpha_max", limits.alpha_max_radps2),
    ):
        if product > bound * (1.0 + 1e-9):
            right = f"must be at most {value} = {bound:g}, or allow_saturation = true (simulation only)"
            raise Refused(f"gains k_per_s, m_mps, b_m: {name} = {product:g}: {right}")
    return gains
