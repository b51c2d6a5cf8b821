"""Crossing of ground features: slow, straight driving over what the wheels can cross."""

from __future__ import annotations

from math import sqrt

from lfa.agents.avoidance.decision import Decision, Situation, decide
from lfa.agents.perception.ground_map import GroundMap
from lfa.protocol.geometry import Twist
from lfa.protocol.mission import Limits

CROSSING_MPS = 0.2
"""Speed [m/s] that is slow enough for the wheels on any crossable feature (control.md section 7)."""
LATE_S = 0.1
"""Delay [s] from a ground profile until the robot brakes."""
NEAR_M = 0.5
"""Distance [m] to a feature's near edge below which the crossing begins."""
BESIDE_M = 0.05
"""Lateral distance [m] inside a wheel's line that a bend may bring the wheel to: the body's edge."""


class GroundCrossing:
    """Crossing by one robot of the features that its ground map shows."""

    def __init__(self, ground: GroundMap, limits: Limits, radius_m: float) -> None:
        self._ground = ground
        self._limits = limits
        self._radius_m = radius_m
        self._crossing_until = 0.0
        self.decision: Decision | None = None
        """Decision to cross, from the approach until the robot is over; None otherwise."""

    def cross(self, wanted: Twist, now: float) -> Twist:
        """Return `wanted`, limited to a straight and slow motion until the whole robot is over the feature.

        On a bend the speed always allows stopping before the ground that the floor sensor shows first.
        """
        ahead, wanted = self._ground.ahead, self._in_sight(wanted)
        if ahead is not None and ahead.near_m < NEAR_M and wanted.linear_x > 0.0:
            row = decide(Situation(ahead.kind, ahead.near_m, ahead.width_m, crossable=True))
            if row is not None:
                self._crossing_until = now + (ahead.near_m + ahead.width_m + 2.0 * self._radius_m) / CROSSING_MPS
                self.decision = Decision(row.action, ahead.near_m, 0.0, ahead.kind, row.name, row.updates)
        if now >= self._crossing_until:
            self.decision = None
            return wanted
        if wanted.linear_x <= CROSSING_MPS:
            return wanted
        return Twist(CROSSING_MPS, wanted.angular_z * CROSSING_MPS / wanted.linear_x)

    def _in_sight(self, wanted: Twist) -> Twist:
        """Limit the speed on a bend to what the floor sensor's range allows.

        The sensor's lines point straight ahead. On a bend of radius R the floor before the inner wheel is `BESIDE_M`
        off its line at a distance of sqrt(2 R BESIDE_M), and was not measured from farther away.
        """
        v, omega = wanted.linear_x, abs(wanted.angular_z)
        if v <= 0.0 or omega == 0.0 or not self._ground.looked:
            return wanted
        seen_m, a = sqrt(2.0 * BESIDE_M * v / omega), self._limits.a_max_mps2
        v_max = sqrt(a * a * LATE_S * LATE_S + 2.0 * a * seen_m) - a * LATE_S
        return wanted if v <= v_max else Twist(v_max, wanted.angular_z * v_max / v)
