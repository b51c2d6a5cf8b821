"""What a run leaves behind: `recording.mcap` with every message, `events.jsonl` with one line for each event.

One `Recorder` for both modes: the simulator feeds it in virtual time, the recorder process (`python -m
lfa.deploy.recording.recorder`) from the bus. It sits outside the control path: nobody waits for it.
"""

from __future__ import annotations

from pathlib import Path
from typing import IO

import msgspec
from msgspec import Struct

from lfa.deploy.recording import mcap_channels
from lfa.deploy.recording.mcap_writer import ChunkWriter
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.team import Event
from lfa.protocol.names import robot_id_of
from lfa.protocol.topics import OPERATOR_NAME, RECORDER_NAME, WORLD_NAME

RECORDING = "recording.mcap"
PART = "recording-{}.mcap"
"""Of a recording in several files, those after the first."""
EVENTS = "events.jsonl"
FLUSH_S = 1.0  # what a SIGKILL of the recorder may cost
ONLOOKERS = (WORLD_NAME, OPERATOR_NAME, RECORDER_NAME)
CHUNK_BYTES_MAX = 4 * 1024 * 1024

_line_encoder = msgspec.json.Encoder(order="deterministic")


class Recording(Struct, kw_only=True):
    """What there is of a recording, and what it lost."""

    messages: int
    files: int
    bytes: int
    missing: int = 0
    """Gaps in the senders' numbers: messages that never came."""
    dropped: int = 0
    """Came, and found the recorder's inbox full."""
    undecodable: int = 0


def parts(folder: Path) -> list[Path]:
    """The files of the recording in `folder`, oldest first; empty when there is none."""
    first, later = folder / RECORDING, folder.glob(PART.format("*"))
    return [first, *sorted(later)] if first.is_file() else []


class Recorder:
    """Writes both files; every message goes to the recording, an Event to its own line as well.

    With `split_bytes` the recording goes on in a new file once one has that size; of these the first, which knows the
    mission, and the newest are kept, `keep` in all (0: all).
    """

    def __init__(self, folder: Path, about: dict[str, str], *, split_bytes: int = 0, keep: int = 0) -> None:
        """`about` (scenario, fleet, mode, seed) goes into the recording. Raises OSError when a file cannot be made."""
        self._folder = folder
        self._about = about
        self._split_bytes = split_bytes
        self._keep = keep
        self._number = 0
        self._bytes = 0
        self._messages = 0
        self._flushed_at = 0.0
        self._events: IO[bytes] = open(folder / EVENTS, "wb", buffering=0)  # noqa: SIM115 (closed by close)
        self._open()

    def record(self, t: float, key: str, message: Message) -> None:
        """`message` travelled on `key`, `t` [s] since the run's start; what came before that is given as 0."""
        t = t if t > 0.0 else 0.0
        channel = self._channels.get(key)
        if channel is None:
            channel = self._channels[key] = self._open_channel(key, type(message))
        stamp_ns = round(t * 1e9)
        self._writer.add_message(channel, stamp_ns, mcap_channels.encode(message), stamp_ns, message.header.seq)
        self._messages += 1
        if isinstance(message, Event):
            self._events.write(event_line(t, message))
        if t >= self._flushed_at + FLUSH_S:
            self.flush_when_due(t)

    def flush_when_due(self, t: float) -> None:
        """Close the chunk every second, so that all before can be read even if this process dies."""
        if t >= self._flushed_at + FLUSH_S:
            self._flushed_at = t
            self._writer.flush()  # type: ignore[no-untyped-call]
            if 0 < self._split_bytes <= self._stream.tell():
                self._close()
                self._open()

    def close(self) -> Recording:
        self._close()
        self._events.close()
        return Recording(messages=self._messages, files=self._number, bytes=self._bytes)

    def _open(self) -> None:
        """Go on in a new file; each can be read without the others."""
        self._number += 1
        name = RECORDING if self._number == 1 else PART.format(f"{self._number:04}")
        self._stream: IO[bytes] = open(self._folder / name, "wb")  # noqa: SIM115 (closed by _close)
        self._writer = ChunkWriter(self._stream, CHUNK_BYTES_MAX)
        self._writer.start(profile="", library="lfa")
        self._writer.add_metadata("run", self._about)
        self._channels: dict[str, int] = {}
        self._schemas: dict[type, int] = {}
        if 0 < self._keep < self._number:
            (self._folder / PART.format(f"{self._number - self._keep + 1:04}")).unlink(missing_ok=True)

    def _close(self) -> None:
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._bytes += self._stream.tell()
        self._stream.close()

    def _open_channel(self, key: str, kind: type) -> int:
        """`lfa/<fleet>/robot1/pose` is recorded as `/robot1/pose`."""
        schema = self._schemas.get(kind)
        if schema is None:
            schema = self._writer.register_schema(f"lfa.{kind.__name__}", "jsonschema", mcap_channels.schema(kind))
            self._schemas[kind] = schema
        return self._writer.register_channel("/" + key.split("/", 2)[2], "json", schema)


def event_line(t: float, event: Event) -> bytes:
    """One line of events.jsonl: when [s], about which robot, in which term, what, who says it, and its data.

    World, operator and recorder speak about others, and may know when: they say `robot` and `t` themselves.
    """
    data = mcap_channels.plain(event.data)
    sender = event.header.sender
    said = data if sender in ONLOOKERS else {}
    head = {
        "t": round(said.get("t", t), 6),
        "robot": said.get("robot", robot_id_of(sender)),
        "term": None if event.term is None else msgspec.structs.astuple(event.term),
        "kind": event.kind,
        "from": sender,
    }
    rest = {name: value for name, value in data.items() if name not in head}
    tail = b"," + _line_encoder.encode(rest)[1:] if rest else b"}"
    return msgspec.json.encode(head)[:-1] + tail + b"\n"
