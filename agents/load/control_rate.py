"""Rate of a robot's control steps and table rows: halved while its machine keeps it late, so that it does less there.

A lease outlives lateness up to a third of itself (E36), and a robot's commands up to its deadman. Before either is used
up, the robot steps less often, and what it publishes with each step goes out less often as well.
"""

from __future__ import annotations

from msgspec.structs import replace

from lfa.agents.following.factory import gains_of
from lfa.agents.team_state import ROW_SPARE_S, table_s
from lfa.protocol.errors import Refused
from lfa.protocol.mission import CONTROL_HZ_MIN, Mission
from lfa.protocol.runtime.lateness import LATE_SECONDS

LATE_SHARE = 0.25
"""Share of the deadman by which a loop must be late, in each of `LATE_SECONDS` seconds, to step less often."""
DIVISORS = (1, 2, 4)
"""By what the usual rates are divided, from step to step down."""
SPARE_PERIODS = 2
"""Usual control periods of the deadman that two commands never use up: the odometry that a command echoes may be one
old, and the command late by one."""
CALM_S, CALM_S_MAX = 10.0, 160.0
"""Time [s] without a late second after which the rate is doubled again; it doubles each time that was too early."""
ROUNDING_S = 1e-9


class ControlRate:
    """Rates of one robot with one mission, by how late its loop was in each second."""

    def __init__(self, mission: Mission, deadman_s: float) -> None:
        """`deadman_s`: age D [s] beyond which the gateway refuses a command."""
        self._mission = mission
        self._late_s = LATE_SHARE * deadman_s
        self._table_s = table_s(len(mission.robots))
        self._slowest = max(divisor for divisor in DIVISORS if _allowed(mission, deadman_s, divisor))
        self._level = 0
        self._late_seconds = 0
        self._calm_s = CALM_S
        self._calm_from = 0.0

    @property
    def control_hz(self) -> float:
        """Present rate [Hz] of the control steps, never lower than the deadman, the gains and any mission allow."""
        return self._mission.control_hz / min(DIVISORS[self._level], self._slowest)

    @property
    def is_low(self) -> bool:
        """True while the rates are lower than usual."""
        return self._level > 0

    @property
    def table_s(self) -> float:
        """Present time [s] between two rows: one that is lost leaves the place in the one before it known."""
        return max(self._table_s, min(DIVISORS[self._level] * self._table_s, ROW_SPARE_S))

    def update(self, lag_s: float, now: float) -> bool:
        """Take the largest lateness [s] of one second; return True if that has changed a rate."""
        before = self.control_hz, self.table_s
        if lag_s > self._late_s:
            self._late_seconds += 1
            self._calm_from = now
            if self._late_seconds >= LATE_SECONDS and self._level < len(DIVISORS) - 1:
                self._level, self._late_seconds = self._level + 1, 0
        else:
            self._late_seconds = 0
            if self._level and now >= self._calm_from + self._calm_s:
                self._level, self._calm_from = self._level - 1, now
                self._calm_s = min(2.0 * self._calm_s, CALM_S_MAX)
        return (self.control_hz, self.table_s) != before

    def text(self) -> str:
        """Return the rates, in words; empty for the usual ones."""
        if not self.is_low:
            return ""
        return f"kept late by its machine: control at {self.control_hz:.3g} Hz, table at {1.0 / self.table_s:.2g} Hz"


def _allowed(mission: Mission, deadman_s: float, divisor: int) -> bool:
    """Return whether a robot may step `divisor` times less often than its mission says."""
    if divisor == 1:
        return True
    slower = replace(mission, control_hz=mission.control_hz / divisor)
    if slower.control_hz < CONTROL_HZ_MIN:
        return False
    if slower.control_period_s + SPARE_PERIODS * mission.control_period_s > deadman_s + ROUNDING_S:
        return False
    try:
        gains_of(slower)  # those of a follower must be low enough for its period
    except Refused:
        return False
    return True
