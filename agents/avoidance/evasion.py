"""Motions out of the way of what moves, and the distance that each of them would keep from it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import hypot, inf

from msgspec import Struct
from msgspec.structs import replace

from lfa.agents.avoidance.decision import Action
from lfa.agents.avoidance.moving_points import ASIDE_SHARE
from lfa.agents.perception.obstacle_tracker import Feature
from lfa.protocol.geometry import Pose2D, Twist, along_arc, in_base, places_along

CLEARANCE_M = 0.6
"""Least distance [m] from the robot's centre to the surface of a moving obstacle; less within the horizon is a
conflict."""
HORIZON_S = 4.0
LOOK_S = 6.0
"""Prediction time [s] for choosing the action with the largest clearance when no action keeps `CLEARANCE_M` within the
horizon: an obstacle that comes slowly from behind has not reached a waiting robot at the end of the horizon."""
STEP_S = 0.25


class Evasion(Struct, frozen=True):
    """Motion out of the way: a bend of `turn_rad` [rad], then straight on, at `v_mps` [m/s]."""

    action: Action
    v_mps: float
    omega_radps: float = 0.0
    turn_rad: float = 0.0


EVASIONS = (
    Evasion(Action.WAIT, 0.0),
    Evasion(Action.RIGHT, 0.45, -0.9, 1.0),
    Evasion(Action.LEFT, 0.45, 0.9, 1.0),
    Evasion(Action.RIGHT, 0.25, -1.2, 1.5),
    Evasion(Action.LEFT, 0.25, 1.2, 1.5),
    Evasion(Action.AHEAD, 0.25),
    Evasion(Action.BACK, -0.25),
)
"""Of two that keep the same distance the first is taken: to the right first, as two that meet both do."""
ESCAPES = (
    Evasion(Action.RIGHT, 0.7, -1.2, 1.5),
    Evasion(Action.LEFT, 0.7, 1.2, 1.5),
    Evasion(Action.AHEAD, 0.7),
    Evasion(Action.BACK, -0.25, -0.9, 1.5),
    Evasion(Action.BACK, -0.25, 0.9, 1.5),
)
"""Further evasions, of what comes close: it may be faster than those of `EVASIONS`, or behind."""
SLOW = Evasion(Action.SLOW, 0.0)
CARE = {Action.SLOW: 0, Action.WAIT: 1}
"""How much more an action does than to slow down; the others do most."""
MOST_CARE = 2
ONWARD = (Action.SLOW, Action.AHEAD)
"""Evasions that are the wanted motion, at another speed."""


def apart_m(moving: Sequence[Feature], place: Pose2D, later_s: float) -> float:
    """Return the least distance [m] from `place` to the surface of what moves, `later_s` [s] from now."""
    return min(hypot(x - place.x, y - place.y) - f.radius_m for f in moving for x, y in [f.at(later_s)])


def leads_to(feature: Feature, pose: Pose2D, twist: Twist) -> bool:
    """Return whether `twist` drives at what moves: the last function before the wheels brakes for it."""
    x, y = in_base(pose, (feature.x, feature.y))
    return twist.linear_x * x > ASIDE_SHARE * hypot(x, y) * abs(twist.linear_x)


def care_of(action: Action) -> int:
    """Return how much an action does: 0 to slow down, 1 to wait, `MOST_CARE` else."""
    return CARE.get(action, MOST_CARE)


def side_of(evasion: Evasion) -> float:
    """Return 1.0 for a bend to the left, -1.0 else."""
    return 1.0 if evasion.omega_radps > 0.0 else -1.0


def kept_m(moving: Sequence[Feature], pose: Pose2D, evasion: Evasion, twist: Twist) -> float:
    """Return the least distance [m] to what moves within `LOOK_S` of an evasion, done by `twist`: its bend, then
    straight on.
    """
    if not evasion.turn_rad:
        return min(closest_m(moving, pose, twist, LOOK_S), CLEARANCE_M)
    bend_s = evasion.turn_rad / abs(twist.angular_z)
    least = closest_m(moving, pose, twist, bend_s)
    later = [replace(f, x=x, y=y, keeps_s=max(0.0, f.keeps_s - bend_s)) for f in moving for x, y in [f.at(bend_s)]]
    straight = Twist(twist.linear_x, 0.0)
    return min(least, closest_m(later, along_arc(pose, twist, bend_s), straight, LOOK_S - bend_s), CLEARANCE_M)


def closest_m(moving: Sequence[Feature], pose: Pose2D, twist: Twist, within_s: float = HORIZON_S) -> float:
    """Return the least distance [m] between the robot's centre and an obstacle's surface within `within_s` [s] from
    now.

    Only approaches count: an obstacle that is already near and moves away is no conflict.
    """
    least = inf
    if not moving:
        return least
    times = _times(round(within_s / STEP_S))
    way = list(zip(times, places_along(pose, twist, times), strict=True))
    for feature in moving:
        x, y, vx, vy, radius_m = feature.x, feature.y, feature.vx, feature.vy, feature.radius_m
        first, keeps_s = hypot(x - pose.x, y - pose.y), feature.keeps_s
        for later, (there_x, there_y) in way:
            later = min(later, keeps_s)
            apart = hypot(x + vx * later - there_x, y + vy * later - there_y)
            if apart < first and apart - radius_m < least:
                least = apart - radius_m
    return least


@lru_cache(maxsize=64)  # bounded: a bend may take any time
def _times(steps: int) -> tuple[float, ...]:
    """Return the times [s] at which a motion is looked at."""
    return tuple(n * STEP_S for n in range(1, steps + 1))
