"""Journal of a Node for replay: its inputs and ticks in order, with a hash of the output of each call.

One file per incarnation of a node. A four-byte length precedes each msgpack entry, so that a file cut off by SIGKILL
is readable up to its last whole entry; one `write` per wake-up hands the entries to the kernel, so that a killed
process does not lose them.
"""

from __future__ import annotations

import errno
import struct
import sys
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct

from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import DamagedFile, decode_msgpack, open_binary
from lfa.protocol.output import AppendedFile, write_line

JOURNAL_VERSION = 1
ENTRY_BYTES_MAX = 16 * 1024 * 1024
"""Maximum size [bytes] of an entry: a heading holds a mission, the others a message."""
PASSING = (errno.ENOSPC, errno.EDQUOT, errno.EIO)
"""errno values of a disk that is full or failing: a robot that restarts goes on without a journal."""


class Heading(Struct, frozen=True):
    """First entry of a journal: the node and its start arguments."""

    version: int
    node: str
    incarnation: int
    floor: int
    config: dict[str, Any]


class JournalEntry(Struct, frozen=True, array_like=True, gc=False):
    """One call of the node. `kind`: `message` (key and payload as received), `local` (payload: the event) or `tick`."""

    kind: str
    at: float
    key: str
    payload: bytes
    digest: int


Call = tuple[str, float, str, bytes, Sequence[tuple[str, bytes]]]
"""A call of a node: kind, time [s], key and payload as in a `JournalEntry`, and the messages that it sent."""
_length = struct.Struct("<I").pack
_encode = msgspec.msgpack.Encoder().encode
_entry_decoder = msgspec.msgpack.Decoder(JournalEntry)
_heading_decoder = msgspec.msgpack.Decoder(Heading)


def digest(sent: Sequence[tuple[str, bytes]]) -> int:
    """Return the CRC-32 over keys and payloads of one call's output; 0 for no output."""
    crc = 0
    for key, payload in sent:
        crc = zlib.crc32(payload, zlib.crc32(key.encode(), crc))
    return crc


class Journal:
    """Writer of one node's journal; without a `directory` it writes nothing."""

    def __init__(self, directory: Path | None, heading: Heading) -> None:
        """Create the file and write its heading. On a full disk there is no journal, as in `flush`.

        Raises Refused where no file can be written, whatever room there is.
        """
        self._file: AppendedFile | None = None
        self._calls: list[Call] = []
        """Calls that are not encoded yet: many of them one after the other take less time than each by itself."""
        self._pending = bytearray()
        if directory is None:
            return
        path = directory / f"{heading.node}-{heading.incarnation}.bin"
        try:
            directory.mkdir(parents=True, exist_ok=True)
            self._file = AppendedFile(path)
        except OSError as error:
            if error.errno not in PASSING:
                raise Refused(f"--journal {directory}: {error.strerror}: must be a folder to write to") from None
            self._end(path, str(error.strerror))
            return
        body = _encode(heading)
        self._pending += len(body).to_bytes(4, "little") + body
        self.flush()

    def add(self, kind: str, at: float, key: str, payload: bytes, sent: Sequence[tuple[str, bytes]]) -> None:
        """Add a call of the node, which sent the messages `sent`."""
        if self._file is not None:
            self._calls.append((kind, at, key, payload, sent))

    def _take_in(self, calls: Sequence[Call]) -> None:
        """Encode added calls."""
        if self._file is not None:
            parts: list[bytes] = []
            for kind, at, key, payload, sent in calls:
                body = _encode((kind, at, key, payload, digest(sent) if sent else 0))  # as a `JournalEntry`
                parts += _length(len(body)), body
            self._pending += b"".join(parts)

    def _take_in_all(self) -> None:
        if self._calls:
            calls, self._calls = self._calls, []
            self._take_in(calls)

    def flush(self) -> None:
        """Write all added entries to the file. On a full disk the journal ends and the robot continues."""
        self._take_in_all()
        if self._file is None or not self._pending:
            return
        if not self._file.append(self._pending):
            self._end(self._file.path, self._file.error)
        self._pending.clear()

    def close(self) -> None:
        self.flush()
        if self._file is not None:
            self._file.close()
            self._file = None

    def _end(self, path: Path, reason: str) -> None:
        write_line(f"{path}: {reason}: the journal ends here", sys.stderr)
        if self._file is not None:
            self._file.close()
            self._file = None


def read(path: Path) -> tuple[Heading, Iterator[JournalEntry]]:
    """Return heading and entries of a journal, up to its last whole entry. Raises ValueError if it is no journal.

    Raises Refused for what is no file in its place; the iterator of entries does at corrupted bytes.
    """
    bodies = _bodies(path)
    try:
        heading = decode_msgpack(next(bodies), _heading_decoder)
    except (StopIteration, DamagedFile) as error:
        raise ValueError(f"{path}: not a journal") from error
    except FileNotFoundError:
        raise
    except OSError as error:
        raise Refused(f"{path}: cannot be read ({error.strerror}): must be a journal as a process wrote it") from None
    return heading, _entries(path, bodies)


def _entries(path: Path, bodies: Iterator[bytes]) -> Iterator[JournalEntry]:
    """Yield the entries. Raises Refused at an undecodable one: its bytes were corrupted, not cut off."""
    for n, body in enumerate(bodies, start=1):
        try:
            yield decode_msgpack(body, _entry_decoder)
        except DamagedFile:
            raise Refused(f"{path}: entry {n} cannot be read: must be a journal as a process wrote it") from None


def _bodies(path: Path) -> Iterator[bytes]:
    """Yield the encoded entries, one in memory at a time, up to the end or to where the file is cut off."""
    with open_binary(path) as file:
        while len(head := file.read(4)) == 4:
            size = int.from_bytes(head, "little")
            body = file.read(size) if size <= ENTRY_BYTES_MAX else b""
            if len(body) < size:
                return
            yield body
