"""Calls in virtual time come in the order of their times, then of their scheduling, however they were scheduled."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf
from random import Random

from lfa.world.virtual_time import SERIES_MIN, VirtualTime

TIMES = (0.0, 0.1, 0.1, 0.2, 0.4)
NEAR_S = 0.15


class Calls(VirtualTime):
    """Virtual time in which calls note themselves; each of them may schedule more."""

    def __init__(self, in_series: bool, seed: int) -> None:
        super().__init__()
        self._in_series = in_series
        self._random = Random(seed)
        self.made: list[tuple[float, int]] = []
        self.foreseen: list[list[tuple[float, int]]] = []
        """What was planned for the near future at each call."""
        self.scheduled = 0

    def schedule(self, count: int) -> None:
        """Schedule so many calls, as a series or one by one, at drawn times of which many are the same."""
        calls = []
        for _ in range(count):
            self.scheduled += 1
            calls.append((self.now + self._random.choice(TIMES), self.note, (self.scheduled,)))
        if self._in_series:
            self.at_each(list(calls))
            return
        for when, action, arguments in calls:
            self.at(when, action, *arguments)

    def note(self, number: int) -> None:
        self.made.append((self.now, number))
        self.foreseen.append([(when, arguments[0]) for when, _, arguments in self.planned(self.now + NEAR_S)])
        if self.scheduled < 2000 and self._random.random() < 0.3:
            self.schedule(self._random.choice((1, 2, SERIES_MIN, 3 * SERIES_MIN)))


def one_by_one_and_in_series(until_s: float, lost_after_s: float = inf) -> Iterator[tuple[Calls, Calls]]:
    """Yield the same calls scheduled one by one and as a series, and run until a time [s].

    Of those scheduled at the beginning the ones after `lost_after_s` [s] are dropped.
    """
    for seed in range(20):
        pair = Calls(False, seed), Calls(True, seed)
        for calls in pair:
            calls.schedule(40)
            calls.lose(lost_after_s, (calls.note,))
            calls.run(until_s)
        yield pair


def test_a_series_of_calls_runs_as_the_same_calls_scheduled_one_by_one() -> None:
    for alone, together in one_by_one_and_in_series(100.0):
        assert together.made == alone.made
        assert len(together.made) == together.scheduled > 40


def test_what_is_planned_of_a_series_is_as_one_by_one() -> None:
    for alone, together in one_by_one_and_in_series(0.5):
        assert together.foreseen == alone.foreseen


def test_what_is_lost_of_a_series_is_as_one_by_one() -> None:
    for alone, together in one_by_one_and_in_series(100.0, lost_after_s=NEAR_S):
        assert together.made == alone.made
        assert len(together.made) < together.scheduled
