"""The world's time as an onlooker knows it: 0 at the world's start, carried forward between two ground truths."""

from __future__ import annotations

from collections import deque

WINDOW = 50  # ground truths: one second


class WorldTime:
    """`at` is the onlooker's own clock [s]. Delays of single messages do not show: the least of a second counts."""

    def __init__(self) -> None:
        self._offsets: deque[float] = deque(maxlen=WINDOW)
        self._offset = 0.0

    @property
    def known(self) -> bool:
        return bool(self._offsets)

    def see(self, at: float, time_s: float) -> None:
        """A ground truth of world time `time_s` came at `at`."""
        self._offsets.append(at - time_s)
        self._offset = min(self._offsets)

    def of(self, at: float) -> float:
        """World time at `at`; 0 before anything is known."""
        return max(0.0, at - self._offset) if self._offsets else 0.0
