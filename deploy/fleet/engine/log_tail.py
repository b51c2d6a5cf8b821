"""Tails of logs, which a supervisor publishes on an order `logs`."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from pathlib import Path

FOLLOW_S = 5.0
"""Duration [s] after an order `logs` for which new lines are published; repeating the order prolongs it."""
LINE_CHARACTERS_MAX = 2000
READ_BYTES_MAX = 16 * 1024
LINES_MAX = 1000


class LogTail(ABC):
    """Tail of a log: its last lines, then the lines appended to it, until `FOLLOW_S` after the newest order."""

    def __init__(self, last: tuple[str, ...], now: float) -> None:
        self._first = last
        self._until = now + FOLLOW_S

    def prolong(self, now: float) -> None:
        self._until = now + FOLLOW_S

    def over(self, now: float) -> bool:
        return now > self._until

    def take(self, now: float) -> tuple[str, ...]:
        """Return the complete lines appended since the last call, enough for one message."""
        first, self._first = self._first, ()
        return first or self._appended()

    @abstractmethod
    def _appended(self) -> tuple[str, ...]:
        """Read what has been appended since the last reading."""


class FileTail(LogTail):
    """Tail of a file, READ_BYTES_MAX at a time."""

    def __init__(self, path: Path, lines: int, now: float) -> None:
        self._path = path
        self._at, last = _last(path, min(lines, LINES_MAX))
        super().__init__(last, now)

    def _appended(self) -> tuple[str, ...]:
        try:
            with self._path.open("rb") as file:
                file.seek(self._at)
                data = file.read(READ_BYTES_MAX)
        except OSError:
            return ()
        whole = data[: data.rfind(b"\n") + 1] if len(data) < READ_BYTES_MAX else data
        self._at += len(whole)
        return _lines(whole)


def _last(path: Path, lines: int) -> tuple[int, tuple[str, ...]]:
    """Return the offset behind the last complete line, and the last lines."""
    try:
        size = os.path.getsize(path)
        with path.open("rb") as file:
            file.seek(max(0, size - READ_BYTES_MAX))
            data = file.read(READ_BYTES_MAX)
    except OSError:
        return 0, ()
    whole = data[: data.rfind(b"\n") + 1]
    return size - len(data) + len(whole), _lines(whole)[-lines:] if lines else ()


def _lines(data: bytes) -> tuple[str, ...]:
    return tuple(line[:LINE_CHARACTERS_MAX] for line in data.decode(errors="replace").splitlines())
