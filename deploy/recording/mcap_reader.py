"""Reader of `recording.mcap` into numpy arrays per robot.

It reads from the front, so a file whose writer was killed yields everything up to its last complete chunk. A recording
in several files is read as one.
"""

from __future__ import annotations

import os
import struct
import sys
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import IO, Any

import msgspec
import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk
from mcap.stream_reader import StreamReader, get_chunk_data_stream
from mcap.writer import MCAP0_MAGIC
from msgspec import Struct
from numpy.typing import NDArray
from zstandard import ZstdError

from lfa.deploy.recording import mcap_channels
from lfa.deploy.recording.recorder import RECORDING, parts
from lfa.protocol.errors import Refused
from lfa.protocol.names import robot_id_of
from lfa.protocol.topics import TOPIC, TRUTH_OWNER

Array = NDArray[np.float64]
Row = tuple[float, ...]


class RecordedRun(Struct):
    """Arrays of a run, one row per message; first column: time [s] since the run's start; columns as in `COLUMNS`."""

    truth: dict[int, Array]
    tracking: dict[int, Array]
    cmd_vel: dict[int, Array]
    obstacles: dict[int, Array]
    """t [s], x [m], y [m] of each moving body, by its index in the scenario's list."""
    commanded: dict[int, Array] = {}
    """t [s], k^d [m], phi^d [rad] of each follower's slot as commanded by the leader, by robot."""

    @property
    def end_s(self) -> float:
        """Time [s] of the last ground truth, 0 when there is none."""
        return max((float(rows[-1, 0]) for rows in self.truth.values()), default=0.0)


COLUMNS: dict[str, tuple[str, ...]] = {
    "truth": ("t", "x", "y", "theta", "linear_x", "angular_z"),
    "tracking": ("t", "predecessor", "separation_m", "phi", "chi", "heading", "error_m", "avoiding"),
    "cmd_vel": ("t", "linear_x", "angular_z", "as_leader"),
}


def read(folder: Path) -> RecordedRun:
    """Return the arrays of the run in `folder`; empty when nothing was recorded."""
    truth: dict[int, list[Row]] = {}
    obstacles: dict[int, list[Row]] = {}
    commanded: dict[int, list[Row]] = {}
    said: dict[str, dict[int, list[Row]]] = {topic: {} for topic in _ROWS}
    for owner, topic, t, message in messages(folder, frozenset({"truth", "formation", *_ROWS})):
        robot = robot_id_of(owner)
        if owner == TRUTH_OWNER:
            for r in message.robots:
                row = (message.time_s, r.x, r.y, r.theta, r.linear_x, r.angular_z)
                truth.setdefault(r.id, []).append(row)
            for body in message.obstacles:
                obstacles.setdefault(body.index, []).append((message.time_s, body.x, body.y))
        elif topic == "formation":
            for slot in message.slots:
                commanded.setdefault(slot.robot, []).append((t, slot.separation_m, slot.phi))
        elif robot is not None and topic in _ROWS:
            said[topic].setdefault(robot, []).append(_ROWS[topic](t, message))
    return RecordedRun(
        _arrays(truth), _arrays(said["tracking"]), _arrays(said["cmd_vel"]), _arrays(obstacles), _arrays(commanded)
    )


def messages(folder: Path, topics: frozenset[str]) -> Iterator[tuple[str, str, float, Any]]:
    """Yield owner, topic, time [s] and content (an object with the wire type's fields) of each message on `topics`.

    Raises Refused for a recording of another program or another version of lfa.
    """
    decoders = {t: msgspec.json.Decoder(mcap_channels.shape(TOPIC[t].type)) for t in topics}
    for channel, t, body in recorded(folder, topics):
        _, owner, topic, *_ = channel.split("/")
        try:
            yield owner, topic, t, decoders[topic].decode(body)
        except msgspec.DecodeError as error:
            by = "version of lfa" if isinstance(error, msgspec.ValidationError) else "program"
            raise Refused(f"{folder / RECORDING}: recorded by another {by}, {channel}: {error}") from None


def look_into(folder: Path) -> None:
    """Raise Refused when `folder` holds no recording; warn on stderr when a recording is truncated."""
    if not (folder / RECORDING).is_file():
        raise Refused(f"{folder}: no run folder, it has no {RECORDING}")
    for path in parts(folder):
        with path.open("rb") as stream:
            size = stream.seek(0, os.SEEK_END)
            stream.seek(max(0, size - len(MCAP0_MAGIC)))
            whole = size > len(MCAP0_MAGIC) and stream.read() == MCAP0_MAGIC
        if not whole:
            print(f"{path}: cut off (its writer was killed, or still writes): shown as far as it goes", file=sys.stderr)


def recorded(folder: Path, topics: frozenset[str]) -> Iterator[tuple[str, float, bytes]]:
    """Yield channel (`/robot1/pose`), time [s] and JSON of each message on `topics`, in the order of the recording."""
    for path in parts(folder):
        yield from _recorded(path, topics)


def _recorded(path: Path, topics: frozenset[str]) -> Iterator[tuple[str, float, bytes]]:
    wanted: dict[int, str] = {}
    with path.open("rb") as stream:
        begins = stream.read(len(MCAP0_MAGIC))
        if not MCAP0_MAGIC.startswith(begins):
            raise Refused(f"{path}: no recording: must be an MCAP file that lfa wrote")
        stream.seek(0)
        for chunk in _chunks(stream):
            for opcode, body in _records(chunk):
                if opcode == Opcode.CHANNEL:
                    channel = Channel.read(ReadDataStream(BytesIO(body)))
                    parts = channel.topic.split("/")
                    if len(parts) > 2 and parts[2] in topics:
                        wanted[channel.id] = channel.topic
                elif opcode == Opcode.MESSAGE:
                    channel_id, _, log_time = _MESSAGE.unpack_from(body)
                    if channel_id in wanted:
                        yield wanted[channel_id], log_time / 1e9, body[_MESSAGE.size :]


_RECORD = struct.Struct("<BQ")  # opcode, length of what follows
_MESSAGE = struct.Struct("<HIQ8x")  # channel, sequence, log time; publish time is skipped


def _chunks(stream: IO[bytes]) -> Iterator[bytes]:
    """Yield the contents of every complete chunk, up to the end or to where the file is truncated."""
    reader = StreamReader(stream, emit_chunks=True)
    try:
        for record in reader.records:
            if isinstance(record, Chunk):
                yield get_chunk_data_stream(record)[0].read(record.uncompressed_size)
    except (McapError, ZstdError, struct.error):
        return


def _records(chunk: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and body of each record; three times as fast as mcap's own reader."""
    at = 0
    while at < len(chunk):
        opcode, length = _RECORD.unpack_from(chunk, at)
        at += _RECORD.size
        yield opcode, chunk[at : at + length]
        at += length


_ROWS: dict[str, Callable[[float, Any], Row]] = {
    "tracking": lambda t, m: (
        t,
        m.predecessor,
        m.separation_m,
        m.phi,
        m.chi,
        m.heading,
        float(m.error_m),
        m.avoiding,
    ),
    "cmd_vel": lambda t, m: (t, m.twist.linear_x, m.twist.angular_z, m.as_leader),
}


def _arrays(rows: dict[int, list[Row]]) -> dict[int, Array]:
    return {robot: np.asarray(rows[robot], dtype=np.float64) for robot in sorted(rows)}
