"""Last function before `cmd_vel`: each published command is finite, within the drive's limits, and slow enough to stop
before the obstacles of the scan.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, copysign, hypot, isfinite, pi, sqrt

from lfa.agents.perception.footprint import Inside, PolygonBody
from lfa.agents.perception.scan import Point, free_along
from lfa.protocol.geometry import STILL, Twist
from lfa.protocol.mission import Limits

SKIN_M = 0.02
"""Distance [m] kept between the body and the nearest point when braking."""
BRAKING_SHARE = 0.8
"""Share of the drive's deceleration that is planned with; the rest covers what a 10 Hz scan has not shown yet."""
ROUNDING_M = 1e-6
TURNING_MPS = 0.1
"""Speed [m/s] below which a turn is not slowed with the motion ahead."""

OBEYED_MPS, OBEYED_RADPS = 0.1, 0.5
"""Maximum difference between command and measured twist while the wheels obey: several periods of full acceleration."""
SHARED_RAD = pi / 3
"""Angle [rad] off the motion, now or after turning for `TURN_S`, within which a team-mate counts as ahead."""
TURN_S = 0.4
RESTS = 1e-6
"""Speed [m/s, rad/s] below which nothing is needed to stop: squares of what fades out would vanish as divisors."""


def safe(
    wanted: Twist,
    last: Twist,
    points: Sequence[Point],
    radius_m: float,
    limits: Limits,
    dt: float,
    footprint: PolygonBody | None = None,
) -> Twist:
    """Return `wanted` made safe. `points` are in `base_link`; `last` is the command before, `dt` [s] ago.

    `footprint` is None for a round body.
    """
    if not (isfinite(wanted.linear_x) and isfinite(wanted.angular_z)):
        wanted = STILL
    v, omega = within(wanted, limits)
    if footprint is not None:
        inside = footprint.inside(points, SKIN_M)
        share = _swept_share(Twist(v, omega), points, inside, footprint, limits)
        wanted = _reached(Twist(v * share, omega * share), last, limits, dt)
        # The drive reaches a bend later than it is wanted, and the body sweeps something else until then.
        share = _swept_share(wanted, points, inside, footprint, limits)
        v, omega = wanted.linear_x * share, wanted.angular_z * share
    else:
        v_stop = _stop_mps(points, Twist(v, omega), radius_m, limits)
        if abs(v) > v_stop:
            scale = v_stop / abs(v)
            # A round body may turn at any distance: what stands before its nose must not hold the turn that frees it.
            v, omega = v * scale, omega * max(scale, 1.0 - v_stop / TURNING_MPS)
        return _on_the_way(Twist(v, omega), last, points, radius_m, limits, dt)
    return _reached(Twist(v, omega), last, limits, dt)


def _stop_mps(points: Sequence[Point], twist: Twist, radius_m: float, limits: Limits) -> float:
    """Return the speed [m/s] from which a round body can stop before what is on the arc of `twist`."""
    return sqrt(2.0 * BRAKING_SHARE * limits.a_max_mps2 * free_along(points, twist, radius_m + SKIN_M))


def _on_the_way(
    wanted: Twist, last: Twist, points: Sequence[Point], radius_m: float, limits: Limits, dt: float
) -> Twist:
    """Return what a round body drives next on its way from `last` to `wanted`, which is free itself.

    The drive reaches another bend or rest later than it is wanted, and drives other arcs until then. Where it could not
    stop on that one, it brakes; and where braking comes too late, it brakes on the arc that it was on.
    """
    next_ = _reached(wanted, last, limits, dt)
    if next_ == wanted or next_.linear_x == 0.0:
        return next_
    v_stop = _stop_mps(points, next_, radius_m, limits)
    if abs(next_.linear_x) <= v_stop:
        return next_
    slower = _near(copysign(v_stop, next_.linear_x), last.linear_x, limits.a_max_mps2 * dt)
    next_ = Twist(slower, next_.angular_z)
    if abs(slower) <= v_stop or last.linear_x * slower <= 0.0:
        return next_
    kept = Twist(slower, _near(last.angular_z * slower / last.linear_x, last.angular_z, limits.alpha_max_radps2 * dt))
    return kept if _stop_mps(points, kept, radius_m, limits) > v_stop else next_


def _swept_share(
    twist: Twist, points: Sequence[Point], inside: Sequence[Inside], footprint: PolygonBody, limits: Limits
) -> float:
    """Return the share of `twist` from which the drive can stop before what the body sweeps, its turn included."""
    v, omega = (0.0 if abs(rate) < RESTS else abs(rate) for rate in (twist.linear_x, twist.angular_z))
    stop_rad = omega * omega / (2.0 * BRAKING_SHARE * limits.alpha_max_radps2)
    if v > 0.0:
        stop_m = v * v / (2.0 * BRAKING_SHARE * limits.a_max_mps2)
        needed_m = max(stop_m, stop_rad * v / omega) if omega > 0.0 else stop_m
        return sqrt(footprint.free_along(points, twist, SKIN_M, needed_m, inside) / needed_m)
    if omega > 0.0:
        return sqrt(footprint.free_turn(points, twist.angular_z, SKIN_M, stop_rad, inside) / stop_rad)
    return 1.0


def sharing(wanted: Twist, mates: Sequence[Point], radius_m: float, limits: Limits, lag_s: float = 0.0) -> Twist:
    """Return `wanted`, slowed towards each of `mates` (centres in `base_link`) to stop within half of the room between:
    the other robot may approach under the same rule. `lag_s` is the time [s] in which the robot drives on as before.
    """
    v = wanted.linear_x
    sign = 1.0 if v >= 0.0 else -1.0
    turn, reach_m = wanted.angular_z * TURN_S, sharing_reach_m(wanted, radius_m, limits, lag_s)
    braking_mps2 = BRAKING_SHARE * limits.a_max_mps2
    for x, y in mates:
        if x * x + y * y > reach_m * reach_m:
            continue
        bearing = atan2(sign * y, sign * x)
        if abs(bearing - max(min(turn, 0.0), min(max(turn, 0.0), bearing))) < SHARED_RAD:
            room_m = max(0.0, 0.5 * (hypot(x, y) - 2.0 * radius_m) - SKIN_M)
            v_max = ((braking_mps2 * lag_s) ** 2 + 2.0 * braking_mps2 * room_m) ** 0.5 - braking_mps2 * lag_s
            if abs(v) > v_max:
                wanted = Twist(sign * v_max, wanted.angular_z * v_max / abs(v))
                v = wanted.linear_x
    return wanted


def sharing_reach_m(wanted: Twist, radius_m: float, limits: Limits, lag_s: float = 0.0) -> float:
    """Return the distance [m] of centres beyond which `sharing` slows `wanted` for no team-mate."""
    stops_within_m = wanted.linear_x * wanted.linear_x / (2.0 * BRAKING_SHARE * limits.a_max_mps2)
    return 2.0 * (radius_m + SKIN_M + abs(wanted.linear_x) * lag_s + stops_within_m) + ROUNDING_M


def obeyed(command: Twist, measured: Twist) -> Twist:
    """Return the twist to publish: the command, which the wheels follow next, so that no delay is added.

    Return the measured twist where the wheels do not obey (an obstacle in contact, a closed gateway).
    """
    off_mps, off_radps = command.linear_x - measured.linear_x, command.angular_z - measured.angular_z
    return command if abs(off_mps) < OBEYED_MPS and abs(off_radps) < OBEYED_RADPS else measured


def within(twist: Twist, limits: Limits) -> tuple[float, float]:
    """Return `twist` scaled into the drive's limits with v/omega kept, so that the path keeps its shape."""
    v, omega = twist.linear_x, twist.angular_z
    v_max = limits.v_max_mps if v >= 0.0 else limits.v_reverse_max_mps
    scale = max(abs(v) / max(v_max, 1e-9), abs(omega) / limits.omega_max_radps, 1.0)
    return v / scale, omega / scale


def turn_on_spot(bearing: float, radps_max: float, limits: Limits) -> Twist:
    """Return the turn towards `bearing` [rad] at `radps_max` [rad/s] at most, from which the drive can stop there."""
    rate = min(radps_max, limits.omega_max_radps, sqrt(2.0 * limits.alpha_max_radps2 * abs(bearing)))
    return Twist(0.0, copysign(rate, bearing))


def _reached(wanted: Twist, last: Twist, limits: Limits, dt: float) -> Twist:
    """Return `wanted` as far as the drive gets from `last` within `dt` [s]."""
    return Twist(
        _near(wanted.linear_x, last.linear_x, limits.a_max_mps2 * dt),
        _near(wanted.angular_z, last.angular_z, limits.alpha_max_radps2 * dt),
    )


def _near(value: float, last: float, step: float) -> float:
    return max(last - step, min(last + step, value))
