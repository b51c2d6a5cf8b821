"""Ctrl-C and SIGTERM as a flag that a loop polls, also while a plug-in does not return."""

from __future__ import annotations

import signal
from collections.abc import Container
from pathlib import Path
from types import FrameType, TracebackType
from typing import Any

ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM)
RETURN_S = 1.0
"""How long [s] after a signal the code of a plug-in may go on before it is left."""


class Interrupts:
    """Context that stores the last SIGINT or SIGTERM in `signal`, and their `count`, instead of ending the process.

    Code of `own_files`, paths of plug-ins, that goes on `RETURN_S` after a signal gets a TimeoutError where it is, and
    `held_in` says where that was: the loop that called it can then poll.
    """

    def __init__(self, own_files: Container[str] | None = None) -> None:
        self.signal: signal.Signals | None = None
        self.count = 0
        self.held_in: str | None = None
        self._own_files = own_files
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Interrupts:
        self._before = {number: signal.signal(number, self._note) for number in ENDING_SIGNALS}
        if self._own_files is not None:
            self._before[signal.SIGALRM] = signal.signal(signal.SIGALRM, self._leave)
        return self

    def __exit__(self, _t: type[BaseException] | None, _e: BaseException | None, _tb: TracebackType | None) -> None:
        if self._own_files is not None:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, before in self._before.items():
            signal.signal(number, before)

    def _note(self, number: int, _frame: FrameType | None) -> None:
        self.signal = signal.Signals(number)
        self.count += 1
        if self._own_files is not None:
            signal.setitimer(signal.ITIMER_REAL, RETURN_S, RETURN_S)

    def _leave(self, _number: int, frame: FrameType | None) -> None:
        assert self._own_files is not None
        while frame is not None and frame.f_code.co_filename not in self._own_files:
            frame = frame.f_back
        if frame is not None:
            self.held_in = f"{Path(frame.f_code.co_filename).name}:{frame.f_lineno}"
            raise TimeoutError(f"went on for {RETURN_S:g} s after a signal")
