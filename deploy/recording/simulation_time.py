"""Estimate of the world's time in an observer session: 0 at the world's start, extrapolated between ground truths."""

from __future__ import annotations

from collections import deque

WINDOW = 50  # number of ground truths: one second


class WorldTime:
    """Offset between the observer's clock and world time, the least over WINDOW messages, which filters delays.

    Every `at` is a time [s] of the observer's own clock.
    """

    def __init__(self) -> None:
        self._offsets: deque[float] = deque(maxlen=WINDOW)
        self._offset = 0.0

    @property
    def known(self) -> bool:
        return bool(self._offsets)

    @property
    def offset(self) -> float:
        """Least (arrival - world time) [s] of the last messages; 0 before the first."""
        return self._offset

    def see(self, at: float, time_s: float) -> None:
        """Update the offset by a ground truth of world time `time_s` [s] that arrived at `at`."""
        offsets, offset = self._offsets, at - time_s
        leaves = offsets[0] if len(offsets) == WINDOW else None
        offsets.append(offset)
        if offset <= self._offset or len(offsets) == 1:
            self._offset = offset
        elif leaves == self._offset:  # only then may the least of the others be another
            self._offset = min(offsets)

    def of(self, at: float) -> float:
        """Return the world time [s] at `at`; 0 before the first ground truth."""
        return max(0.0, at - self._offset) if self._offsets else 0.0
