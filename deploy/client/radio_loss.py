"""Share of the other robots' rows that a robot's radio lost of late, from the counters of its status. Pure."""

from __future__ import annotations

from collections import deque
from typing import Any

RADIO_S = 10.0
"""Time window [s] of the share of lost rows."""


class RadioLoss:
    """Counters of the last `RADIO_S`, of each robot."""

    def __init__(self) -> None:
        self._past: dict[int, deque[tuple[float, float, float]]] = {}

    def share(self, t: float, robot: int, counters: dict[str, Any]) -> float | None:
        """Return the share of rows that `robot` lost before `t` [s], None if it could have heard none."""
        heard, lost = float(counters.get("rows_heard", 0.0)), float(counters.get("rows_lost", 0.0))
        past = self._past.setdefault(robot, deque())
        if past and heard < past[-1][1]:  # the process was restarted
            past.clear()
        past.append((t, heard, lost))
        while t - past[0][0] > RADIO_S:
            past.popleft()
        came, missed = heard - past[0][1], lost - past[0][2]
        return missed / (came + missed) if came + missed > 0.0 else None
