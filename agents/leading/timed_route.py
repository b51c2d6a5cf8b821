"""Trajectory tracking: a route whose way-points are due at given times (the paper's second type of motion).

The leader's reference is a point that moves along the route. The leader drives at that point's speed plus a share of
its distance behind the point. The time lost in a detour is made up for as far as `cruise_mps` allows.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

from lfa.protocol.mission import Leading

GAIN_PER_S = 0.5
LAG_M_MAX = 5.0
"""Lag [m] beyond which the speed does not increase any more."""


class Timetable:
    """Timetable of one leader. Its clock starts when it begins to lead, at the time that is due at its present
    place.
    """

    def __init__(self, leading: Leading) -> None:
        self._leading = leading
        self._at_m: list[float] = []
        self._zero = 0.0

    def begin(self, waypoints_m: Sequence[float], progress_m: float, now: float) -> None:
        """Start the trajectory at `progress_m` along a route that passes its way-points at `waypoints_m`."""
        self._at_m = list(waypoints_m)
        self._zero = now - _between(progress_m, self._at_m, self._leading.times_s)

    def due_m(self, now: float) -> float:
        """Return the arc length [m] of the point where the leader should be."""
        return _between(now - self._zero, self._leading.times_s, self._at_m)

    def speed(self, progress_m: float, now: float) -> float:
        """Return the speed [m/s] for the next step, from 0 to `cruise_mps`."""
        if not self._at_m:
            return 0.0
        due_m = self.due_m(now)
        pace = (self.due_m(now + 0.5) - due_m) / 0.5
        behind_m = min(due_m - progress_m, LAG_M_MAX)
        return max(0.0, min(self._leading.cruise_mps, pace + GAIN_PER_S * behind_m))


def _between(x: float, xs: Sequence[float], ys: Sequence[float]) -> float:
    """Interpolate linearly from `xs` to `ys`, clamped to the ends."""
    if x <= xs[0]:
        return ys[0]
    if x >= xs[-1]:
        return ys[-1]
    n = bisect_right(xs, x) - 1
    return ys[n] + (ys[n + 1] - ys[n]) * (x - xs[n]) / (xs[n + 1] - xs[n])
