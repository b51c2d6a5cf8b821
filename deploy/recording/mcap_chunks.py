"""Bounded reading of the chunks of an MCAP file, whatever its bytes are (MCAP specification: records, chunks).

A file whose writer was killed is read up to its last whole chunk. Damaged bytes end the reading with a line on standard
error. A chunk may expand to CHUNK_BYTES_MAX, all chunks together to EXPANSION_MAX times their size on disk.
"""

from __future__ import annotations

import os
import struct
import sys
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO

import zstandard
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from lfa.protocol.errors import Refused
from lfa.protocol.output import write_line

CHUNK_BYTES_MAX = 32 * 1024 * 1024
"""Maximum size [bytes] of a chunk in memory: eight times that of a full one of lfa's writer."""
EXPANSION_MAX, EXPANSION_FREE_BYTES = 200, 64 * 1024 * 1024
"""Maximum ratio of all chunks' size in memory to that on disk, from this size [bytes] on; recordings have 5 to 15."""

Record = tuple[int, bytes]
"""Opcode and body of a record in a chunk."""

_RECORD = struct.Struct("<BQ")  # opcode, length of what follows
_CHUNK = struct.Struct("<QQQII")  # start time, end time, size in memory, its CRC, length of the compression's name
_LENGTH = struct.Struct("<Q")


class _DamagedChunk(ValueError):
    """Chunk that is no chunk of lfa's writer."""


def records(path: Path) -> Iterator[Record]:
    """Yield the records of all chunks in order. Raises Refused for another format, OSError."""
    expanded = 0
    with path.open("rb") as stream:
        if not MCAP0_MAGIC.startswith(stream.read(len(MCAP0_MAGIC))):
            raise Refused(f"{path}: no recording: must be an MCAP file that lfa wrote")
        try:
            for at, chunk in _chunks(stream):
                expanded += len(chunk)
                if expanded > EXPANSION_FREE_BYTES + EXPANSION_MAX * stream.tell():
                    raise _DamagedChunk(f"expands more than {EXPANSION_MAX}-fold up to byte {at}")
                yield from _records(chunk)
        except _DamagedChunk as error:
            write_line(f"{path}: damaged ({error}): shown as far as it goes", sys.stderr)


def _chunks(stream: IO[bytes]) -> Iterator[tuple[int, bytes]]:
    """Yield place in the file and content of every whole chunk. Raises _DamagedChunk."""
    size = os.fstat(stream.fileno()).st_size
    while len(head := stream.read(_RECORD.size)) == _RECORD.size:
        at = stream.tell()
        opcode, length = _RECORD.unpack(head)
        if opcode in (0, Opcode.DATA_END, Opcode.FOOTER) or at + length > size:
            return
        if opcode != Opcode.CHUNK:
            stream.seek(length, os.SEEK_CUR)
            continue
        if length > CHUNK_BYTES_MAX:
            raise _DamagedChunk(f"a chunk of {length} bytes at byte {at}")
        try:
            yield at, _expand(stream.read(length))
        except (struct.error, zstandard.ZstdError, ValueError) as error:
            raise _DamagedChunk(f"chunk at byte {at}: {error}") from None


def _expand(body: bytes) -> bytes:
    """Return the content of the chunk record `body`. Raises ValueError, struct.error and ZstdError."""
    _, _, size, crc, name_length = _CHUNK.unpack_from(body)
    name_end = _CHUNK.size + name_length
    compression, (length,) = body[_CHUNK.size : name_end], _LENGTH.unpack_from(body, name_end)
    data = body[name_end + _LENGTH.size :]
    if size > CHUNK_BYTES_MAX or length != len(data):
        raise ValueError(f"{size} bytes in memory, {length} on disk")
    if compression == b"zstd":
        if zstandard.frame_content_size(data) not in (-1, size):  # -1: unknown
            raise ValueError(f"expands to another size than {size} bytes")
        data = zstandard.ZstdDecompressor(max_window_size=CHUNK_BYTES_MAX).decompress(data, max_output_size=size)
    elif compression:
        raise ValueError(f"compression {compression[:20]!r}: must be zstd or none")
    if len(data) != size or (crc and zlib.crc32(data) != crc):
        raise ValueError("its check sum differs")
    return data


def _records(chunk: bytes) -> Iterator[Record]:
    """Yield the records of a chunk; three times as fast as mcap's own reader. Raises _DamagedChunk."""
    at = 0
    while at < len(chunk):
        if at + _RECORD.size > len(chunk):
            raise _DamagedChunk("half a record")
        opcode, length = _RECORD.unpack_from(chunk, at)
        at += _RECORD.size
        if opcode == 0 or at + length > len(chunk):
            raise _DamagedChunk("a record that is none, or longer than its chunk")
        yield opcode, chunk[at : at + length]
        at += length
