"""Lines of a log file as they come: what a supervisor says of its processes' logs."""

from __future__ import annotations

import os
from pathlib import Path

FOLLOW_S = 5.0
"""So long after an order to show a log its new lines are said too; who wants more says it again."""
LINE_CHARACTERS_MAX = 2000
READ_BYTES_MAX = 16 * 1024
LINES_MAX = 1000


class Tail:
    """The last lines of a file, then what comes."""

    def __init__(self, path: Path, lines: int, now: float) -> None:
        self._path = path
        self._until = now + FOLLOW_S
        self._at, self._first = _last(path, min(lines, LINES_MAX))

    def prolong(self, now: float) -> None:
        self._until = now + FOLLOW_S

    def over(self, now: float) -> bool:
        return now > self._until

    def take(self, now: float) -> tuple[str, ...]:
        """Whole lines that have come since the last call, a message's worth at most."""
        first, self._first = self._first, ()
        if first:
            return first
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
    """Where the file ends, and its last lines."""
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
