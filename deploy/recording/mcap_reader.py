"""Reader of `recording.mcap` into numpy arrays per robot.

It reads from the front, so a file whose writer was killed yields everything up to its last complete chunk. A recording
in several files is read as one.
"""

from __future__ import annotations

import os
import struct
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, ClassVar

import msgspec
import numpy as np
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC
from msgspec import Struct
from numpy.typing import NDArray

from lfa.deploy.recording import mcap_channels
from lfa.deploy.recording.mcap_chunks import records
from lfa.deploy.recording.recorder import RECORDING, TIME_S_MAX, parts
from lfa.deploy.terminal_text import print_visible
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
    rows = RunRows()
    for owner, topic, t, message in messages(folder, RunRows.TOPICS):
        rows.add(owner, topic, t, message)
    return rows.arrays()


class RunRows:
    """Rows of a run's arrays, collected message by message."""

    TOPICS: ClassVar[frozenset[str]] = frozenset({"truth", "formation", "tracking", "cmd_vel"})

    def __init__(self) -> None:
        self._truth: dict[int, list[Row]] = {}
        self._obstacles: dict[int, list[Row]] = {}
        self._commanded: dict[int, list[Row]] = {}
        self._said: dict[str, dict[int, list[Row]]] = {topic: {} for topic in _ROWS}

    def add(self, owner: str, topic: str, t: float, message: Any) -> None:
        """Add a message of one of `TOPICS`, published at `t` [s]."""
        robot = robot_id_of(owner)
        if owner == TRUTH_OWNER:
            for r in message.robots:
                row = (message.time_s, r.x, r.y, r.theta, r.linear_x, r.angular_z)
                self._truth.setdefault(r.id, []).append(row)
            for body in message.obstacles:
                self._obstacles.setdefault(body.index, []).append((message.time_s, body.x, body.y))
        elif topic == "formation":
            for slot in message.slots:
                self._commanded.setdefault(slot.robot, []).append((t, slot.separation_m, slot.phi))
        elif robot is not None and topic in _ROWS:
            self._said[topic].setdefault(robot, []).append(_ROWS[topic](t, message))

    def arrays(self) -> RecordedRun:
        """Return all rows as arrays."""
        truth, obstacles, commanded = _arrays(self._truth), _arrays(self._obstacles), _arrays(self._commanded)
        return RecordedRun(truth, _arrays(self._said["tracking"]), _arrays(self._said["cmd_vel"]), obstacles, commanded)


def messages(folder: Path, topics: frozenset[str]) -> Iterator[tuple[str, str, float, Any]]:
    """Yield owner, topic, time [s] and content (an object with the wire type's fields) of each message on `topics`.

    Raises Refused for a recording of another program or another version of lfa.
    """
    decoders = {t: msgspec.json.Decoder(mcap_channels.shape(TOPIC[t].type)) for t in topics}
    for channel, t, body in recorded(folder, topics):
        _, owner, topic, *_ = channel.split("/")
        try:
            yield owner, topic, t, decoders[topic].decode(body)
        except (msgspec.DecodeError, ValueError, RecursionError) as error:
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
            print_visible(
                f"{path}: cut off (its writer was killed, or still writes): shown as far as it goes", file=sys.stderr
            )


def recorded(folder: Path, topics: frozenset[str]) -> Iterator[tuple[str, float, bytes]]:
    """Yield channel (`/robot1/pose`), time [s] and JSON of each message on `topics`, in the order of the recording."""
    for path in parts(folder):
        yield from _recorded(path, topics)


def _recorded(path: Path, topics: frozenset[str]) -> Iterator[tuple[str, float, bytes]]:
    wanted: dict[int, str] = {}
    for opcode, body in records(path):
        if opcode == Opcode.CHANNEL:
            channel_id, topic = _channel(path, body)
            parts = topic.split("/")
            if len(parts) > 2 and parts[2] in topics:
                wanted[channel_id] = topic
        elif opcode == Opcode.MESSAGE and len(body) >= _MESSAGE.size:
            channel_id, _, log_time = _MESSAGE.unpack_from(body)
            if channel_id in wanted:
                if log_time > TIME_S_MAX * 1e9:
                    raise Refused(f"{path}: a message of {log_time / 1e9:g} s: by another program, or damaged")
                yield wanted[channel_id], log_time / 1e9, body[_MESSAGE.size :]


_MESSAGE = struct.Struct("<HIQ8x")  # channel, sequence, log time; publish time is skipped
_CHANNEL = struct.Struct("<HHI")  # id, schema, length of the topic


def _channel(path: Path, body: bytes) -> tuple[int, str]:
    """Return id and topic of a channel record. Raises Refused."""
    try:
        channel_id, _, length = _CHANNEL.unpack_from(body)
        return channel_id, body[_CHANNEL.size : _CHANNEL.size + length].decode()
    except (struct.error, UnicodeDecodeError):
        raise Refused(f"{path}: a channel that cannot be read: recorded by another program, or damaged") from None


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
    try:
        return {robot: np.asarray(rows[robot], dtype=np.float64) for robot in sorted(rows)}
    except OverflowError as error:
        raise Refused(f"{RECORDING}: a number that no lfa records ({error})") from None
