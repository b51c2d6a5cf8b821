"""Each Node's own inputs and ticks, in order, and a hash of what each call returned: what a replay reads.

One file for each life of a node. A four-byte length precedes each msgpack entry, so that a file cut off by SIGKILL is
read up to its last whole entry; one `write` a wake-up puts the entries where a dead process cannot lose them.
"""

from __future__ import annotations

import os
import sys
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct

from lfa.protocol.errors import Refused

JOURNAL_VERSION = 1


class Heading(Struct, frozen=True):
    """First entry: which node this is and what it was started with."""

    version: int
    node: str
    incarnation: int
    floor: int
    config: dict[str, Any]


class JournalEntry(Struct, frozen=True, array_like=True, gc=False):
    """One call. `kind` is `message` (key and payload as they came), `local` (payload is the local event) or `tick`."""

    kind: str
    at: float
    key: str
    payload: bytes
    digest: int


_encoder = msgspec.msgpack.Encoder()
_entry_decoder = msgspec.msgpack.Decoder(JournalEntry)
_heading_decoder = msgspec.msgpack.Decoder(Heading)


def digest(sent: Sequence[tuple[str, bytes]]) -> int:
    """CRC-32 over keys and payloads of what one call returned; 0 for nothing."""
    crc = 0
    for key, payload in sent:
        crc = zlib.crc32(payload, zlib.crc32(key.encode(), crc))
    return crc


class Journal:
    """Writes one node's journal; `directory` None keeps none."""

    def __init__(self, directory: Path | None, heading: Heading) -> None:
        """Raises OSError when the file cannot be made."""
        self._file: int | None = None
        self._pending = bytearray()
        if directory is None:
            return
        directory.mkdir(parents=True, exist_ok=True)
        self._path = directory / f"{heading.node}-{heading.incarnation}.bin"
        self._file = os.open(self._path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
        self._append(heading)
        self.flush()

    def add(self, kind: str, at: float, key: str, payload: bytes, sent: Sequence[tuple[str, bytes]]) -> None:
        if self._file is not None:
            self._append(JournalEntry(kind, at, key, payload, digest(sent)))

    def flush(self) -> None:
        """Hand everything added so far to the kernel. On a full disk the journal ends; the robot does not."""
        if self._file is None or not self._pending:
            return
        try:
            os.write(self._file, self._pending)
        except OSError as error:
            print(f"{self._path}: {error.strerror}: the journal ends here", file=sys.stderr, flush=True)
            os.close(self._file)
            self._file = None
        self._pending.clear()

    def close(self) -> None:
        self.flush()
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def _append(self, entry: Struct) -> None:
        body = _encoder.encode(entry)
        self._pending += len(body).to_bytes(4, "little")
        self._pending += body


def read(path: Path) -> tuple[Heading, Iterator[JournalEntry]]:
    """Heading and entries of a journal, up to its last whole entry. Raises ValueError when it is none.

    The entries raise Refused where bytes were changed.
    """
    bodies = _bodies(path.read_bytes())
    try:
        heading = _heading_decoder.decode(next(bodies))
    except (StopIteration, msgspec.DecodeError) as error:
        raise ValueError(f"{path}: not a journal") from error
    return heading, _entries(path, bodies)


def _entries(path: Path, bodies: Iterator[bytes]) -> Iterator[JournalEntry]:
    """Raises Refused where one of them is no entry: bytes that were changed, not cut off."""
    for n, body in enumerate(bodies, start=1):
        try:
            yield _entry_decoder.decode(body)
        except (msgspec.DecodeError, UnicodeDecodeError):
            raise Refused(f"{path}: entry {n} cannot be read: must be a journal as a process wrote it") from None


def _bodies(data: bytes) -> Iterator[bytes]:
    at = 0
    while at + 4 <= len(data):
        size = int.from_bytes(data[at : at + 4], "little")
        if at + 4 + size > len(data):
            return
        yield data[at + 4 : at + 4 + size]
        at += 4 + size
