"""What the leaders of the bench drive: a straight line, a circle, a figure-eight, each slow enough for its chain."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import pi, sin, sqrt

from lfa.agents.formation.formation import PLANNED_MARGIN, leader_speed_cap
from lfa.protocol.geometry import Twist
from lfa.protocol.messages.team import Slot
from lfa.protocol.mission import Limits

CRUISE_MPS = 0.5
ACCELERATION_MPS2 = 0.5
EIGHT = 2.404825557695773
"""First zero of the Bessel function J0: theta(s) = EIGHT cos(2 pi s / lap) closes to a figure-eight."""
LOOK_M = 1.0
LOOK_STEP_M = 0.05

Curvature = Callable[[float], float]


def straight(s: float) -> float:
    return 0.0


def circle(radius_m: float) -> Curvature:
    return lambda s: 1.0 / radius_m


def figure_eight(lap_m: float) -> Curvature:
    """Smallest radius lap / 15.11."""
    return lambda s: EIGHT * 2.0 * pi / lap_m * sin(2.0 * pi * s / lap_m)


class Leader:
    """Drives a curvature over arc length; the twist of each step is that of its middle."""

    def __init__(
        self, curvature: Curvature, slots: Sequence[Slot], limits: Limits, *, stop_at_m: float = float("inf")
    ) -> None:
        self._curvature = curvature
        self._slots = slots
        self._limits = limits
        self._stop_at_m = stop_at_m
        self.s = 0.0
        self.v = 0.0

    def step(self, dt: float) -> Twist:
        rest = max(0.0, self._stop_at_m - self.s)
        allowed = min(CRUISE_MPS, sqrt(2.0 * ACCELERATION_MPS2 * rest), self._ahead())
        step = ACCELERATION_MPS2 * dt
        self.v = max(0.0, min(self.v + step, max(self.v - step, allowed)))
        way = self.v * dt
        curvature = self._curvature(self.s + 0.5 * way)
        self.s += way
        return Twist(self.v, self.v * curvature)

    def _ahead(self) -> float:
        """Speed from which that of every bend within `LOOK_M` can still be reached."""
        allowed, s = CRUISE_MPS, 0.0
        while s <= LOOK_M:
            cap = leader_speed_cap(self._slots, self._curvature(self.s + s), self._limits, PLANNED_MARGIN)
            allowed = min(allowed, sqrt(cap * cap + 2.0 * ACCELERATION_MPS2 * s))
            s += LOOK_STEP_M
        return allowed
