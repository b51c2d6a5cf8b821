"""Virtual time: a heap of scheduled calls, and the clocks of processes relative to it.

The one engine of every simulation: of whole nodes (`simulator.py`) and of leases alone (`lfa fuzz`). No real clock is
read, and calls at the same time come in the order in which they were scheduled: the same calls give the same run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from heapq import heapify, heappop, heappush, heapreplace
from math import inf
from typing import Any, Self

from msgspec import Struct

SERIES_MIN = 8
"""Number of calls from which a series of them takes less time than each by itself."""


class LocalClock(Struct, frozen=True):
    """Clock of a process relative to true time: local = offset + rate * true."""

    offset_s: float = 0.0
    rate: float = 1.0

    def local(self, true_s: float) -> float:
        return self.offset_s + self.rate * true_s

    def true(self, local_s: float) -> float:
        return (local_s - self.offset_s) / self.rate


class VirtualTime:
    """Scheduled calls in true time from 0; `now` is true time [s] and never goes back."""

    def __init__(self) -> None:
        self.now = 0.0
        self._halted = False
        self._until = -inf
        """End [s] of the present `run`; -inf between two, when calls may come that are not scheduled."""
        self._heap: list[tuple[float, int, Callable[..., None] | None, Any]] = []
        """Scheduled calls: time [s], order, action and arguments; of a series its next call's, None, and the series."""
        self._order = 0

    def at(self, when: float, action: Callable[..., None], *arguments: Any) -> None:
        """Schedule `action` with `arguments` at true time `when` [s]."""
        self._order += 1
        heappush(self._heap, (when, self._order, action, arguments))

    def at_each(self, calls: list[tuple[float, Callable[..., None], tuple[Any, ...]]]) -> None:
        """Schedule each of `calls` (true time [s], action, arguments), as one after the other by `at`.

        Many of them stand in the heap as one: with a message to each of a thousand robots from each of them, all that
        happens would otherwise be sorted in among a million calls.
        """
        if len(calls) < SERIES_MIN:
            for when, action, arguments in calls:
                self._order += 1
                heappush(self._heap, (when, self._order, action, arguments))
            return
        first = self._order + 1
        self._order += len(calls)
        series = [(when, order, action, arguments) for order, (when, action, arguments) in enumerate(calls, first)]
        series.sort(reverse=True)
        heappush(self._heap, (*series[-1][:2], None, series))

    def run(self, until: float) -> Self:
        """Advance to true time `until` [s], or up to the call during which `halt` was called."""
        heap, self._halted, self._until = self._heap, False, until
        while heap and heap[0][0] <= until:
            when, _, action, arguments = heap[0]
            if action is None:
                series = arguments
                _, _, action, arguments = series.pop()
                if series:
                    heapreplace(heap, (series[-1][0], series[-1][1], None, series))
                else:
                    heappop(heap)
            else:
                heappop(heap)
            if when > self.now:
                self.now = when
            action(*arguments)
            if self._halted:
                break
        else:
            self.now = max(self.now, until)
        self._until = -inf
        return self

    def planned(self, by: float) -> list[tuple[float, Callable[..., None], tuple[Any, ...]]]:
        """Return the calls scheduled up to true time `by` [s] that the present `run` comes to, in their order."""
        last = min(by, self._until)
        near = sorted(event for event in self._single() if event[0] <= last)
        return [(when, action, arguments) for when, _, action, arguments in near]

    def halt(self) -> None:
        """End the present `run` with the call under way; the next one goes on from there."""
        self._halted = True

    def lose(self, by: float, actions: tuple[Callable[..., None], ...]) -> None:
        """Drop the scheduled calls of `actions` that are later than true time `by` [s]."""
        self._heap[:] = [event for event in self._single() if event[0] <= by or event[2] not in actions]
        heapify(self._heap)

    def _single(self) -> Iterator[tuple[float, int, Callable[..., None], tuple[Any, ...]]]:
        """Yield all scheduled calls, those of a series one by one."""
        for when, order, action, arguments in self._heap:
            if action is None:
                yield from arguments
            else:
                yield when, order, action, arguments
