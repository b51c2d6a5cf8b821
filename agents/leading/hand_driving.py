"""Driving the leader by hand: an operator's twist in the place of the route's (`lfa teleop`).

What keeps a leader safe acts on it as on any other: braking before obstacles, limits, the age of scans and pose.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, isfinite
from typing import Any

from lfa.protocol.geometry import STILL, Twist
from lfa.protocol.mission import Limits

HOLD_S = 0.25
"""Age [s] of the last twist beyond which the leader brakes: five messages lost."""
SESSION_S = 2.0
"""Silence [s] of the operator after which the leader goes on with its route."""


class HandDriving:
    """Newest twist of an operator at one robot."""

    def __init__(self) -> None:
        self._twist = STILL
        self._at = -inf

    def hear(self, arguments: Mapping[str, Any], now: float) -> None:
        """Take the speeds `v_mps` and `omega_radps` of a message; what are no numbers is dropped."""
        v, omega = arguments.get("v_mps"), arguments.get("omega_radps")
        if all(isinstance(value, int | float) and isfinite(value) for value in (v, omega)):
            self._twist, self._at = Twist(float(v or 0.0), float(omega or 0.0)), now

    def active(self, now: float) -> bool:
        """Return True while an operator drives by hand."""
        return now - self._at <= SESSION_S

    def wanted(self, limits: Limits, now: float) -> Twist | None:
        """Return the twist within `limits`, still once the last one is too old; None if nobody drives by hand."""
        if not self.active(now):
            return None
        if now - self._at > HOLD_S:
            return STILL
        v = min(max(self._twist.linear_x, -limits.v_reverse_max_mps), limits.v_max_mps)
        omega = min(max(self._twist.angular_z, -limits.omega_max_radps), limits.omega_max_radps)
        return Twist(v, omega)
