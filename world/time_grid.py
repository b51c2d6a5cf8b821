"""The grid of a world's time, t0 + n/rate, by its process's clock: which points are due, and how late they come."""

from __future__ import annotations

from math import floor, inf

CATCH_UP_STEPS_MAX = 20
"""Largest number of steps in one tick; after a longer pause the world's time has stood still for the rest."""
ROUNDING = 1e-6
"""Tolerance, as a fraction of a step, by which a tick may come early."""


class TimeGrid:
    """Points of time from the first tick on, which is due at `start_at` [s] or at once; `step` is the next one's index.

    A world that was saved goes on at a later `step` than 0.
    """

    def __init__(self, rate_hz: float, step: int, start_at: float | None) -> None:
        self.dt_s = 1.0 / rate_hz
        self.step = step
        self.slowed_s = 0.0
        """Total time [s] for which the world's time has stood still because ticks came too late."""
        self._first = step
        self._begun = False
        self._t0 = -inf if start_at is None else start_at - step * self.dt_s

    @property
    def next_point(self) -> float:
        """Time [s] of the next point by the process's clock."""
        return self._t0 + self.step * self.dt_s

    @property
    def elapsed_s(self) -> float:
        """Time [s] of the next point since the world began."""
        return self.step * self.dt_s

    @property
    def is_first(self) -> bool:
        """True at the first point of this process, before which nothing has moved."""
        return self.step == self._first

    def begin(self, now: float) -> bool:
        """Let the first point be `now` if it is due; return True the one time that this happens."""
        if self._begun or now < self.next_point:
            return False
        self._begun = True
        self._t0 = now - self.step * self.dt_s
        return True

    def due(self, now: float) -> tuple[int, float]:
        """Return how many points to make up for until `now`, and the time [s] that the world has stood still for."""
        count = floor((now - self._t0) / self.dt_s + ROUNDING) - self.step + 1
        stood_still_s = max(count - CATCH_UP_STEPS_MAX, 0) * self.dt_s
        self._t0 += stood_still_s
        self.slowed_s += stood_still_s
        return min(count, CATCH_UP_STEPS_MAX), stood_still_s

    def samples(self, rate_hz: float) -> bool:
        """Return True if a sample at `rate_hz` falls into the step that ends at the next point."""
        part = rate_hz * self.dt_s
        return floor(self.step * part + ROUNDING) > floor((self.step - 1) * part + ROUNDING)

    def time_of(self, now: float) -> float:
        """Return the time [s] since the world began."""
        return now - self._t0 if self._begun else self.elapsed_s
