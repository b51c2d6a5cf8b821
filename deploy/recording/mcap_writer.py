"""MCAP writer with a fast `add_message`, which is called 100,000 times a minute.

The library's writer creates an object for each message and writes it field by field, in ten calls, which takes as long
as the rest of the recording. Here one call packs all fields. Files are built from the library's public record types
(MCAP specification: header, chunks with their message indexes, summary, footer) and are the same, byte for byte.
"""

from __future__ import annotations

import zlib
from collections import defaultdict
from collections.abc import Iterable
from struct import Struct, pack

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC

from lfa.protocol.output import AppendedFile

COMPRESSION = "zstd"
_OPCODE = int(Opcode.MESSAGE)
UINT32 = 0xFFFFFFFF
_MESSAGE = Struct("<BQHIQQ")
"""Record header (opcode, length), then message header (channel, sequence, log time, publish time)."""
_FIELDS_BYTES = _MESSAGE.size - 9
_INDEX_BYTES = 2 + 4
"""Length [bytes] of a message index without entries: channel, length of the array."""
_ENTRY_BYTES = 8 + 8
"""Length [bytes] of an entry of a message index: log time, place in the chunk."""
_FOOTER = Struct("<BQQQ")
"""First part of the footer, which the summary's CRC covers: opcode, length, starts of summary and summary offsets."""
_FOOTER_BYTES = 20


class ChunkWriter:
    """Writer of compressed chunks of up to `chunk_size` bytes into `file`.

    A chunk that the disk refuses is dropped whole: the file stays readable, and goes on when there is room.
    """

    def __init__(self, file: AppendedFile, chunk_size: int) -> None:
        self._file = file
        self._size_max = chunk_size
        self.unwritten = 0
        """Number of messages in dropped chunks."""
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._chunks: list[ChunkIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._counts: dict[int, int] = defaultdict(int)
        """Messages of each channel."""
        self._from_ns, self._until_ns = 0, 0
        self._chunk_from_ns, self._chunk_until_ns = 0, 0
        self._begin_chunk()

    def start(self, profile: str, library: str) -> bool:
        """Write the file's beginning; return False if the disk refuses it."""
        return self._file.append(MCAP0_MAGIC + _bytes_of([Header(profile, library)]))

    def register_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Add a schema; return its id."""
        self._schemas.append(Schema(id=len(self._schemas) + 1, data=data, encoding=encoding, name=name))
        self._into_chunk(self._schemas[-1])
        return self._schemas[-1].id

    def register_channel(self, topic: str, encoding: str, schema_id: int) -> int:
        """Add a channel; return its id."""
        channel = Channel(
            id=len(self._channels) + 1, topic=topic, message_encoding=encoding, schema_id=schema_id, metadata={}
        )
        self._channels.append(channel)
        self._into_chunk(channel)
        return channel.id

    def add_metadata(self, name: str, data: dict[str, str]) -> None:
        """Write a metadata record."""
        offset, written = self._file.size, _bytes_of([Metadata(name=name, metadata=data)])
        if self._file.append(written):
            self._metadata.append(MetadataIndex(offset=offset, length=len(written), name=name))

    def add_message(self, channel_id: int, log_time: int, data: bytes, publish_time: int, sequence: int = 0) -> None:
        """Add a message to the chunk in progress; times in ns. Of `sequence` MCAP keeps the lower 32 bits."""
        if not self._indexes or log_time < self._chunk_from_ns:
            self._chunk_from_ns = log_time
        if log_time > self._chunk_until_ns:
            self._chunk_until_ns = log_time
        index, chunk = self._indexes.get(channel_id), self._chunk
        if index is None:
            index = self._indexes[channel_id] = []
        index += (log_time, len(chunk))
        chunk += _MESSAGE.pack(
            _OPCODE, _FIELDS_BYTES + len(data), channel_id, sequence & UINT32, log_time, publish_time
        )
        chunk += data
        if len(chunk) > self._size_max:
            self._end_chunk()

    def flush(self) -> None:
        """Hand the chunk in progress to the kernel, if it holds a message."""
        self._end_chunk()

    def finish(self) -> None:
        """Write the last chunk, the summary and the footer, in one piece; the file stays open."""
        self._end_chunk()
        end = _bytes_of([DataEnd(0)])
        start, summary, offsets = self._file.size + len(end), bytearray(), list[SummaryOffset]()
        for opcode, records in self._summary():
            written = _bytes_of(records)
            offsets.append(SummaryOffset(opcode, start + len(summary), len(written)))
            summary += written
        offsets_start = start + len(summary)
        summary += _bytes_of(offsets)
        covered = _FOOTER.pack(Opcode.FOOTER, _FOOTER_BYTES, start, offsets_start)
        footer = Footer(summary_start=start, summary_offset_start=offsets_start, summary_crc=0)
        footer.summary_crc = zlib.crc32(covered, zlib.crc32(summary))
        self._file.append(end + bytes(summary) + _bytes_of([footer]) + MCAP0_MAGIC)

    def _summary(self) -> Iterable[tuple[Opcode, Iterable[McapRecord]]]:
        """Yield the groups of the summary in their order."""
        statistics = Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunks),
            message_count=sum(self._counts.values()),
            metadata_count=len(self._metadata),
            message_start_time=self._from_ns,
            message_end_time=self._until_ns,
            schema_count=len(self._schemas),
        )
        yield Opcode.SCHEMA, self._schemas
        yield Opcode.CHANNEL, self._channels
        yield Opcode.STATISTICS, [statistics]
        yield Opcode.CHUNK_INDEX, self._chunks
        yield Opcode.ATTACHMENT_INDEX, []
        yield Opcode.METADATA_INDEX, self._metadata

    def _into_chunk(self, record: McapRecord) -> None:
        self._chunk += _bytes_of([record])
        if len(self._chunk) > self._size_max:
            self._end_chunk()

    def _begin_chunk(self) -> None:
        self._chunk = bytearray()
        self._indexes: dict[int, list[int]] = {}
        """Log time [ns] and place of each message in the chunk, one after the other, by channel."""
        self._chunk_from_ns, self._chunk_until_ns = 0, 0

    def _end_chunk(self) -> None:
        """Write the chunk and its message indexes; one without a message goes on."""
        if not self._indexes:
            return
        data = bytes(self._chunk)
        chunk = Chunk(
            compression=COMPRESSION,
            data=zstandard.compress(data),
            message_start_time=self._chunk_from_ns,
            message_end_time=self._chunk_until_ns,
            uncompressed_crc=zlib.crc32(data),
            uncompressed_size=len(data),
        )
        offset, written = self._file.size, _bytes_of([chunk])
        index_at, offsets, indexes = offset + len(written), dict[int, int](), bytearray()
        for channel_id, index in self._indexes.items():
            offsets[channel_id] = index_at + len(indexes)
            indexes += _message_index(channel_id, index)
        if not self._file.append(written + indexes):
            self._drop_chunk()
            return
        self._count_chunk()
        self._chunks.append(
            ChunkIndex(
                message_start_time=chunk.message_start_time,
                message_end_time=chunk.message_end_time,
                chunk_start_offset=offset,
                chunk_length=len(written),
                message_index_offsets=offsets,
                message_index_length=len(indexes),
                compression=COMPRESSION,
                compressed_size=len(chunk.data),
                uncompressed_size=len(data),
            )
        )
        self._begin_chunk()

    def _count_chunk(self) -> None:
        """Add the written chunk to the statistics of the file."""
        self._from_ns = min(self._from_ns, self._chunk_from_ns) if self._chunks else self._chunk_from_ns
        self._until_ns = max(self._until_ns, self._chunk_until_ns)
        for channel_id, index in self._indexes.items():
            self._counts[channel_id] += len(index) // 2

    def _drop_chunk(self) -> None:
        """Count the messages of the chunk, and begin the next with the schemas and channels that it may have held."""
        self.unwritten += sum(len(index) // 2 for index in self._indexes.values())
        self._begin_chunk()
        self._chunk += _bytes_of([*self._schemas, *self._channels])


def _message_index(channel_id: int, index: list[int]) -> bytes:
    """Return a message index record; the library writes it number by number."""
    size = len(index) // 2 * _ENTRY_BYTES
    head = (Opcode.MESSAGE_INDEX, _INDEX_BYTES + size, channel_id, size)
    return pack(f"<BQHI{len(index)}Q", *head, *index)


def _bytes_of(records: Iterable[McapRecord]) -> bytes:
    """Return the records as they stand in a file."""
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]
