"""Ctrl-C and SIGTERM as a flag that a loop polls."""

from __future__ import annotations

import signal
from types import FrameType, TracebackType
from typing import Any

ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interrupts:
    """Context that stores the last SIGINT or SIGTERM in `signal`, and their `count`, instead of ending the process."""

    def __init__(self) -> None:
        self.signal: signal.Signals | None = None
        self.count = 0
        self._before: list[Any] = []

    def __enter__(self) -> Interrupts:
        self._before = [signal.signal(number, self._note) for number in ENDING_SIGNALS]
        return self

    def __exit__(self, _t: type[BaseException] | None, _e: BaseException | None, _tb: TracebackType | None) -> None:
        for number, before in zip(ENDING_SIGNALS, self._before, strict=True):
            signal.signal(number, before)

    def _note(self, number: int, _frame: FrameType | None) -> None:
        self.signal = signal.Signals(number)
        self.count += 1
