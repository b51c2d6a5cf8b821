"""State hashes of a run in virtual time, a row for each control period: they show at which tick two runs first differ.

A process is a function of its inputs and times, so the hash of all its calls so far stands for its state. Inputs and
outputs are hashed apart: the process that differs first has the same inputs and other outputs.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path

from lfa.protocol.output import AppendedFile
from lfa.protocol.runtime.journal import Call, Heading, Journal

HASHES = "state_hashes.txt"
ENDED = "-"
"""Hash of a process that does not run."""
FLUSH_ROWS = 50
_time = struct.Struct("<d").pack


class HashedJournal(Journal):
    """Journal with running CRC-32s over the node's inputs, with their times [s], and over its outputs."""

    def __init__(self, directory: Path, heading: Heading) -> None:
        super().__init__(directory, heading)
        self._inputs = self._outputs = 0

    def add(self, kind: str, at: float, key: str, payload: bytes, sent: Sequence[tuple[str, bytes]]) -> None:
        self._calls.append((kind, at, key, payload, sent))  # also where a full disk has ended the file

    def hashes(self) -> tuple[int, int]:
        """Return the CRC-32 of all inputs added so far, and that of all outputs."""
        self._take_in_all()
        return self._inputs, self._outputs

    def _take_in(self, calls: Sequence[Call]) -> None:
        super()._take_in(calls)
        heard: list[bytes] = []
        said: list[bytes] = []
        for _, at, key, payload, sent in calls:
            heard += _time(at), key.encode(), payload
            for to, message in sent:
                said += to.encode(), message
        self._inputs = zlib.crc32(b"".join(heard), self._inputs)
        self._outputs = zlib.crc32(b"".join(said), self._outputs)


class StateHashes:
    """Writer of `state_hashes.txt`: tick, time [s], and `inputs/outputs` of each process of the run."""

    def __init__(self, folder: Path, names: Sequence[str]) -> None:
        """Open the file, with a column for each of the `names`. Raises OSError."""
        self._names = tuple(names)
        self._file = AppendedFile(folder / HASHES, fresh=True)
        self._rows = [f"tick time_s {' '.join(names)}"]

    def write(self, tick: int, now: float, running: Mapping[str, Journal]) -> None:
        """Add the row of a tick at `now` [s], with the journals of the processes that run."""
        columns = (_column(running.get(name)) for name in self._names)
        self._rows.append(f"{tick} {now:.6f} {' '.join(columns)}")
        if len(self._rows) >= FLUSH_ROWS:
            self._flush()

    def close(self) -> None:
        self._flush()
        self._file.close()

    def _flush(self) -> None:
        self._file.append("".join(f"{row}\n" for row in self._rows).encode())
        self._rows.clear()


def _column(journal: Journal | None) -> str:
    return "{:08x}/{:08x}".format(*journal.hashes()) if isinstance(journal, HashedJournal) else ENDED
