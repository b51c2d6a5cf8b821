"""Points that stand for what moves, for the functions that know points only: the detour, and the last brake."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, hypot, inf, sin

from lfa.agents.perception.obstacle_model import resting
from lfa.agents.perception.obstacle_tracker import Feature
from lfa.agents.perception.scan import Point
from lfa.protocol.geometry import TAU, Pose2D

SHADOW_S, SHADOW_STEPS, SHADOW_M_MAX = 8.0, 3, 1.2
"""Time [s] ahead for which a detour keeps out of the way of what moves slowly, the number of places on it, and the way
[m] up to which it counts as slow."""
BERTH_S, BERTH_POINTS = 0.6, 12
"""Time [s] of the motion of what turns again and again, in any direction, that a detour leaves room for, and the number
of points around it."""
AWAY_M = 0.08
"""Clearance [m] that is left when a robot drives towards what moves; nearer, it drives away from it or stands."""
MET_M = 0.01
"""Distance [m] from the robot's centre, in the direction of what comes over it, of the point that stands for it."""
ASIDE_SHARE = 0.5
"""Cosine of the angle off the robot's motion beyond which what comes towards it comes from the side."""


def standing(
    points: list[Point], moving: Sequence[Feature], pose: Pose2D, radius_m: float, *, patient: bool
) -> list[Point]:
    """Return the points (in `base_link`) of all that a robot goes round. A `patient` one gives way to what keeps its
    course; what turns again and again it goes round in any case, at a distance.
    """
    if not patient:
        return points + shadow(moving, pose)
    return resting(points, pose, [feature for feature in moving if feature.keeps_s == inf]) + berth(
        moving, pose, radius_m
    )


def shadow(moving: Sequence[Feature], pose: Pose2D) -> list[Point]:
    """Return, in `base_link`, points of the places to which what moves slowly comes next: a detour leads behind it."""
    c, s, points = cos(pose.theta), sin(pose.theta), list[Point]()
    for feature in moving:
        speed = hypot(feature.vx, feature.vy)
        if speed * SHADOW_S > SHADOW_M_MAX:
            continue
        for n in range(1, SHADOW_STEPS + 1):
            x, y = feature.at(SHADOW_S * n / SHADOW_STEPS)
            reach = feature.radius_m / max(speed, 1e-6)
            for left in (-1.0, 0.0, 1.0):
                side = reach * (1.0 - abs(left))
                dx = x + side * feature.vx - left * reach * feature.vy - pose.x
                dy = y + side * feature.vy + left * reach * feature.vx - pose.y
                points.append((c * dx + s * dy, c * dy - s * dx))
    return points


def berth(moving: Sequence[Feature], pose: Pose2D, radius_m: float) -> list[Point]:
    """Return, in `base_link`, points on a circle around each thing that turns again and again, as far out as it may
    come within `BERTH_S`: what goes nowhere is gone round like what stands, but not as closely. Where a robot of
    `radius_m` is within that circle already, it bars no way out.
    """
    c, s, points = cos(pose.theta), sin(pose.theta), list[Point]()
    for feature in moving:
        dx, dy = feature.x - pose.x, feature.y - pose.y
        reach_m = feature.radius_m + BERTH_S * hypot(feature.vx, feature.vy)
        if feature.keeps_s == inf or hypot(dx, dy) < reach_m + radius_m + AWAY_M:
            continue
        for n in range(BERTH_POINTS):
            x, y = dx + reach_m * cos(n * TAU / BERTH_POINTS), dy + reach_m * sin(n * TAU / BERTH_POINTS)
            points.append((c * x + s * y, c * y - s * x))
    return points


def before(moving: Sequence[Feature], pose: Pose2D, within_s: float, v_mps: float) -> list[Point]:
    """Return, in `base_link`, the points that the surfaces of what moves reach towards the robot within `within_s` [s]:
    the last function before the wheels brakes for them as for what stands.

    The robot wants to drive at `v_mps` [m/s]. For what comes from the side it does not brake: at rest it would be met.
    """
    points: list[Point] = []
    if not moving:
        return points
    c, s = cos(pose.theta), sin(pose.theta)
    for feature in moving:
        x, y = feature.at(within_s)
        dx, dy = x - pose.x, y - pose.y
        apart = hypot(dx, dy)
        share = 1.0 - (feature.radius_m + AWAY_M) / max(apart, MET_M)
        if _meets(feature, pose, within_s):  # where it is then, it has come through the robot: it comes from here
            dx, dy = feature.x - pose.x, feature.y - pose.y
            apart = hypot(dx, dy)
            share = MET_M / max(apart, MET_M)
        elif share <= 0.0 or apart >= hypot(feature.x - pose.x, feature.y - pose.y):
            continue
        px, py = c * dx + s * dy, c * dy - s * dx
        if v_mps * px >= ASIDE_SHARE * apart * abs(v_mps):
            points.append((share * px, share * py))
    return points


def _meets(feature: Feature, pose: Pose2D, within_s: float) -> bool:
    """Return whether what moves comes over the robot's centre, but for `AWAY_M`, within `within_s` [s]."""
    dx, dy, square = feature.x - pose.x, feature.y - pose.y, feature.vx**2 + feature.vy**2
    nearest_s = -(dx * feature.vx + dy * feature.vy) / square if square else 0.0
    if nearest_s <= 0.0:
        return False
    x, y = feature.at(min(nearest_s, within_s))
    return hypot(x - pose.x, y - pose.y) <= feature.radius_m + AWAY_M
