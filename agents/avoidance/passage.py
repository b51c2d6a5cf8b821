"""Passage that a polygon gets through only squarely: the middle line between what the scan shows to both sides of it.

A planned route comes to a narrow place as its cells do, some centimetres beside the middle and aslant. A round body has
only to move aside there; a polygon touches with a corner, and cannot turn between two walls.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import atan2, cos, hypot, inf, sin

from lfa.agents.perception.scan import Point
from lfa.protocol.geometry import Pose2D

LOOK_M, STEP_M = 1.8, 0.2
"""Distance [m] ahead on the route up to which a passage is looked for, and between two of its places."""
DEEP_M = 0.35
"""Distance [m] along the route before and behind its narrowest place of what bounds a passage."""
TURN_RAD, COARSE_RAD, FINE_RAD = 0.6, 0.1, 0.02
"""Largest angle [rad] of a passage off the route, and the steps in which the widest strip is looked for."""


def passage(points: Sequence[Point], route: Callable[[float], Point], least_m: float, narrow_m: float) -> Pose2D | None:
    """Return the middle of the first place on `route` that is narrower than `narrow_m` [m], and the direction of the
    widest strip that leads through it; None when there is none, or when the strip is narrower than `least_m` [m].

    `points` are in `base_link`, and so is `route(s)`, the point `s` [m] ahead.
    """
    narrowest: tuple[float, Pose2D] | None = None
    for n in range(round(LOOK_M / STEP_M) + 1):
        (x, y), (nx, ny) = route(n * STEP_M), route(n * STEP_M + STEP_M)
        if hypot(nx - x, ny - y) < 1e-3:
            break
        at = Pose2D(x, y, atan2(ny - y, nx - x))
        left, right = _beside(points, at, STEP_M, narrow_m)
        width_m = min([y for _, y in left], default=inf) - max([y for _, y in right], default=-inf)
        if width_m < (narrow_m if narrowest is None else narrowest[0]):
            narrowest = width_m, at
        elif narrowest is not None:
            break
    return None if narrowest is None else _strip(points, narrowest[1], least_m, narrow_m)


def _beside(points: Sequence[Point], at: Pose2D, deep_m: float, narrow_m: float) -> tuple[list[Point], list[Point]]:
    """Return the points to the left and to the right of `at`, as seen from there."""
    c, s, left, right = cos(at.theta), sin(at.theta), list[Point](), list[Point]()
    for px, py in points:
        dx, dy = px - at.x, py - at.y
        along_m, aside_m = c * dx + s * dy, c * dy - s * dx
        if -deep_m < along_m < deep_m and -narrow_m < aside_m < narrow_m:
            (left if aside_m > 0.0 else right).append((along_m, aside_m))
    return left, right


def _strip(points: Sequence[Point], at: Pose2D, least_m: float, narrow_m: float) -> Pose2D | None:
    """Return the middle of the widest strip about `at` that leads between the points, and its direction."""
    left, right = _beside(points, at, DEEP_M, narrow_m)
    if not left or not right:
        return None
    best_rad = 0.0
    for step_rad, most_rad in ((COARSE_RAD, TURN_RAD), (FINE_RAD, COARSE_RAD)):
        steps = round(most_rad / step_rad)
        turns = [best_rad + n * step_rad for n in sorted(range(-steps, steps + 1), key=abs)]
        best_rad = max(turns, key=lambda turn_rad: _width_m(left, right, turn_rad))
    if _width_m(left, right, best_rad) < least_m:
        return None
    c, s = cos(best_rad), sin(best_rad)
    middle_m = 0.5 * (min(c * y - s * x for x, y in left) + max(c * y - s * x for x, y in right))
    theta = at.theta + best_rad
    return Pose2D(at.x - sin(theta) * middle_m, at.y + cos(theta) * middle_m, theta)


def _width_m(left: Sequence[Point], right: Sequence[Point], turn_rad: float) -> float:
    c, s = cos(turn_rad), sin(turn_rad)
    return min([c * y - s * x for x, y in left]) - max([c * y - s * x for x, y in right])
