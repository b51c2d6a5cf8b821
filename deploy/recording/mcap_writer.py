"""The mcap library's writer, with the one call that comes a hundred thousand times a minute made for that.

The library makes an object of each message and writes it field by field, ten calls: as much time as all the rest of
recording takes together. Here it is one. The file is the same, byte for byte.
"""

from __future__ import annotations

from struct import Struct
from typing import IO

from mcap.opcode import Opcode
from mcap.records import MessageIndex
from mcap.writer import CompressionType, Writer

_MESSAGE = Struct("<BQHIQQ")
"""Of a record: what it is and how long. Of a message: its channel, its number, when it was logged and published."""
_FIELDS_BYTES = _MESSAGE.size - 9


class ChunkWriter(Writer):
    """Writes compressed chunks of up to `chunk_size` bytes; reaches into the release of mcap that is pinned."""

    def __init__(self, stream: IO[bytes], chunk_size: int) -> None:
        super().__init__(stream, chunk_size, CompressionType.ZSTD)
        self._chunk = self._Writer__chunk_builder  # type: ignore[attr-defined]
        self._statistics = self._Writer__statistics  # type: ignore[attr-defined]
        self._size_max = chunk_size

    def add_message(self, channel_id: int, log_time: int, data: bytes, publish_time: int, sequence: int = 0) -> None:
        chunk, statistics = self._chunk, self._statistics
        if statistics.message_count == 0 or log_time < statistics.message_start_time:
            statistics.message_start_time = log_time
        if log_time > statistics.message_end_time:
            statistics.message_end_time = log_time
        statistics.channel_message_counts[channel_id] += 1
        statistics.message_count += 1
        if chunk.num_messages == 0 or log_time < chunk.message_start_time:
            chunk.message_start_time = log_time
        if log_time > chunk.message_end_time:
            chunk.message_end_time = log_time
        chunk.num_messages += 1
        index = chunk.message_indices.get(channel_id)
        if index is None:
            index = chunk.message_indices[channel_id] = MessageIndex(channel_id, [])
        records = chunk.record_writer
        index.records.append((log_time, records.count))
        size = _FIELDS_BYTES + len(data)
        records.write(_MESSAGE.pack(Opcode.MESSAGE, size, channel_id, sequence, log_time, publish_time) + data)
        if records.count > self._size_max:
            self.flush()  # type: ignore[no-untyped-call]
