"""Trajectories of the bench's leaders: straight line, circle, figure-eight, at a speed that the chain can follow."""

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
"""First zero of the Bessel function J0; theta(s) = EIGHT cos(2 pi s / lap) closes to a figure-eight."""
LOOK_M = 1.0
LOOK_STEP_M = 0.05

Curvature = Callable[[float], float]


def straight(_s: float) -> float:
    """Return the curvature [1/m] of a straight line: 0."""
    return 0.0


def circle(radius_m: float) -> Curvature:
    """Return the curvature [1/m] of a left circle as a function of the arc length [m]."""
    return lambda s: 1.0 / radius_m


def figure_eight(lap_m: float) -> Curvature:
    """Return the curvature [1/m] of a figure-eight as a function of the arc length [m]; least radius lap / 15.11."""
    return lambda s: EIGHT * 2.0 * pi / lap_m * sin(2.0 * pi * s / lap_m)


class Leader:
    """Leader on a curvature over arc length; the twist of each step uses the curvature at its middle."""

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
        """Advance by `dt` [s] and return the twist; the speed is limited by cruise, stop point, and bends ahead."""
        rest = max(0.0, self._stop_at_m - self.s)
        allowed = min(CRUISE_MPS, sqrt(2.0 * ACCELERATION_MPS2 * rest), self._ahead())
        step = ACCELERATION_MPS2 * dt
        self.v = max(0.0, min(self.v + step, max(self.v - step, allowed)))
        way = self.v * dt
        curvature = self._curvature(self.s + 0.5 * way)
        self.s += way
        return Twist(self.v, self.v * curvature)

    def _ahead(self) -> float:
        """Return the speed [m/s] from which the leader can brake for every bend within `LOOK_M`."""
        allowed, s = CRUISE_MPS, 0.0
        while s <= LOOK_M:
            cap = leader_speed_cap(self._slots, self._curvature(self.s + s), self._limits, PLANNED_MARGIN)
            allowed = min(allowed, sqrt(cap * cap + 2.0 * ACCELERATION_MPS2 * s))
            s += LOOK_STEP_M
        return allowed
