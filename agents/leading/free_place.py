"""Free place beside a way-point on which something stands, such as the body of a robot that died at the goal."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, hypot, sin

from lfa.agents.avoidance.safety import SKIN_M
from lfa.protocol.geometry import Point, Pose2D, in_base

FREE_WITHIN_M = 1.0
"""Distance [m] from a way-point within which a free place replaces it."""
TAKEN_S = 3.0
"""Time [s] for which something must stand on the way-point: what moves passes over it sooner."""
NEAR_M = 1.5
"""Distance [m] to the way-point within which a robot looks whether something stands on it."""
STEP_M, MARGIN_M = 0.05, 0.08
"""Step of the search, and clearance [m] beyond the body: a detour begins at less."""


class FreePlace:
    """Search of one leader for the place at which to pass a way-point that is taken."""

    def __init__(self, radius_m: float) -> None:
        self._radius_m = radius_m
        self._taken_since: float | None = None
        self.none_left = False
        """True when something stands on the way-point, and no place within `FREE_WITHIN_M` of it is free."""

    def reset(self) -> None:
        """Look at another way-point from now on."""
        self._taken_since, self.none_left = None, False

    def look(self, waypoint: Point, points: Sequence[Point], pose: Pose2D, now: float) -> Point | None:
        """Return the free place in `map` nearest to `waypoint` on the line to `pose`, once the way-point has been taken
        for `TAKEN_S`; None otherwise. `points` are those of the scan, in `base_link`.

        Only that line is searched: what lies behind the obstacle is not seen.
        """
        x, y = in_base(pose, waypoint)
        apart_m = hypot(x, y)
        if apart_m > NEAR_M or self._is_free((x, y), points, SKIN_M):
            self.reset()
            return None
        if self._taken_since is None:
            self._taken_since = now
        if now - self._taken_since < TAKEN_S:
            return None
        for n in range(1, round(min(FREE_WITHIN_M, apart_m) / STEP_M) + 1):
            share = 1.0 - n * STEP_M / max(apart_m, STEP_M)
            if self._is_free((share * x, share * y), points, MARGIN_M):
                c, s = cos(pose.theta), sin(pose.theta)
                return pose.x + share * (c * x - s * y), pose.y + share * (s * x + c * y)
        self.none_left = apart_m > FREE_WITHIN_M
        return None

    def _is_free(self, place: Point, points: Sequence[Point], clearance_m: float) -> bool:
        limit = (self._radius_m + clearance_m) ** 2
        return all((px - place[0]) ** 2 + (py - place[1]) ** 2 >= limit for px, py in points)
