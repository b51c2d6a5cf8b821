"""What a run leaves behind: `recording.mcap` with every message, `events.jsonl` with one line for each event.

One `Recorder` for both modes: the simulator feeds it in virtual time, the recorder process (`python -m
deploy.run.record`) from the bus. It sits outside the control path: nobody waits for it.
"""

from __future__ import annotations

from pathlib import Path
from typing import IO

import msgspec
from mcap.writer import CompressionType, Writer

from deploy.run import channels
from protocol.messages import Event, Message
from protocol.mission import robot_id_of
from protocol.topics import OPERATOR_NAME, RECORDER_NAME, WORLD_NAME

RECORDING = "recording.mcap"
EVENTS = "events.jsonl"
FLUSH_S = 1.0  # what a SIGKILL of the recorder may cost
ONLOOKERS = (WORLD_NAME, OPERATOR_NAME, RECORDER_NAME)
CHUNK_BYTES_MAX = 4 * 1024 * 1024

_line_encoder = msgspec.json.Encoder(order="deterministic")


class Recorder:
    """Writes both files; every message goes to the recording, an Event to its own line as well."""

    def __init__(self, folder: Path, about: dict[str, str]) -> None:
        """`about` (scenario, fleet, mode, seed) goes into the recording. Raises OSError when a file cannot be made."""
        self._events: IO[bytes] = open(folder / EVENTS, "wb", buffering=0)  # noqa: SIM115 (closed by close)
        self._stream: IO[bytes] = open(folder / RECORDING, "wb")  # noqa: SIM115
        self._writer = Writer(self._stream, chunk_size=CHUNK_BYTES_MAX, compression=CompressionType.ZSTD)
        self._writer.start(profile="", library="lfa")
        self._writer.add_metadata("run", about)
        self._channels: dict[str, int] = {}
        self._schemas: dict[type, int] = {}
        self._flushed_at = 0.0

    def record(self, t: float, key: str, message: Message) -> None:
        """`message` travelled on `key`, `t` [s] since the run's start; what came before that is given as 0."""
        t = max(t, 0.0)
        channel = self._channels.get(key)
        if channel is None:
            channel = self._channels[key] = self._open_channel(key, type(message))
        stamp_ns = round(t * 1e9)
        self._writer.add_message(channel, stamp_ns, channels.encode(message), stamp_ns, message.header.seq)
        if isinstance(message, Event):
            self._events.write(event_line(t, message))
        self.flush_when_due(t)

    def flush_when_due(self, t: float) -> None:
        """Close the chunk every second, so that all before can be read even if this process dies."""
        if t >= self._flushed_at + FLUSH_S:
            self._flushed_at = t
            self._writer.flush()  # type: ignore[no-untyped-call]

    def close(self) -> None:
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._stream.close()
        self._events.close()

    def _open_channel(self, key: str, kind: type) -> int:
        """`lfa/<fleet>/robot1/pose` is recorded as `/robot1/pose`."""
        schema = self._schemas.get(kind)
        if schema is None:
            schema = self._writer.register_schema(f"lfa.{kind.__name__}", "jsonschema", channels.schema(kind))
            self._schemas[kind] = schema
        return self._writer.register_channel("/" + key.split("/", 2)[2], "json", schema)


def event_line(t: float, event: Event) -> bytes:
    """One line of events.jsonl: when [s], about which robot, in which term, what, who says it, and its data.

    World, operator and recorder speak about others, and may know when: they say `robot` and `t` themselves.
    """
    data = channels.plain(event.data)
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
