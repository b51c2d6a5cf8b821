"""Narrow gaps ahead on the route: where a formation does not pass side by side, the team falls into column in time."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from lfa.agents.perception.scan import Point

LOOK_M, STEP_M = 2.5, 0.25
"""Distance [m] ahead up to which gaps are looked for, and between two of the route's points that are looked at."""
BESIDE_M = 1.5
"""Distance [m] to the route up to which a point counts as the side of a gap."""
BODIES, ROOM_M = 2.0, 0.6
"""A gap is narrow below this number of bodies and this room [m] beside them."""


def narrow_gap_m(
    points: Sequence[Point], route: Callable[[float], Point], radius_m: float, half_width_m: float | None = None
) -> float | None:
    """Return the width [m] of the narrowest gap ahead that only a column passes; None when there is none. What no body
    passes is no gap: the route leads through an obstacle there, and a detour round it.

    `points` are in `base_link`, and so is `route(s)`, the point `s` [m] ahead on the route. `half_width_m` is the room
    that a body needs to either side of a straight way; None: it is round.
    """
    narrowest, least = 2.0 * BODIES * radius_m + ROOM_M, 2.0 * (radius_m if half_width_m is None else half_width_m)
    found = None
    for n in range(1, round(LOOK_M / STEP_M) + 1):
        x, y = route(n * STEP_M)
        left, right = BESIDE_M, -BESIDE_M
        for px, py in points:
            if abs(px - x) < STEP_M:
                aside = py - y
                if 0.0 <= aside < left:
                    left = aside
                elif right < aside < 0.0:
                    right = aside
        if left < BESIDE_M and right > -BESIDE_M and least <= left - right < narrowest:
            found = narrowest = left - right
    return found
