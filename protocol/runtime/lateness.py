"""Whether the own loop keeps being late: one late second is nothing, several in a row are an overload."""

from __future__ import annotations

from collections import deque

LATE_SECONDS = 3
"""Number of seconds in a row in each of which the loop must have been late for a robot to say so: a single pause of the
machine is no overload."""


class Lateness:
    """Whether the own loop keeps being so late that commands grow too old: its machine runs more than it can."""

    def __init__(self, late_s: float) -> None:
        """`late_s`: lateness [s] that is too much."""
        self._late_s = late_s
        self._lags_s: deque[float] = deque(maxlen=LATE_SECONDS)
        self.worst_s = 0.0
        """Largest lateness [s] of the last `LATE_SECONDS` seconds, while the loop is late; 0 otherwise."""

    def update(self, lag_s: float) -> bool:
        """Take the largest lateness [s] of one second; return True if the loop has become late, or no longer is."""
        was_late = self.worst_s > 0.0
        self._lags_s.append(lag_s)
        if len(self._lags_s) == LATE_SECONDS and min(self._lags_s) > self._late_s:
            self.worst_s = max(self._lags_s)
        elif max(self._lags_s) <= self._late_s:
            self.worst_s = 0.0
        return was_late != (self.worst_s > 0.0)

    def text(self) -> str:
        """Return how late the loop is, in words; empty while it keeps time."""
        return f"late: by up to {1000.0 * self.worst_s:.0f} ms, the machine is too busy" if self.worst_s > 0.0 else ""
