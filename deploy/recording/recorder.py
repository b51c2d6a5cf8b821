"""Recorder of a run: `recording.mcap` with every message, `events.jsonl` with one line for each event.

One `Recorder` serves both modes: the simulator feeds it in virtual time, the recorder process (`python -m
lfa.deploy.run.recorder_process`) from the bus. It is outside the control path: no process waits for it.
"""

from __future__ import annotations

import sys
from contextlib import suppress
from errno import ENOSPC
from pathlib import Path

import msgspec
from msgspec import Struct

from lfa.deploy.recording import mcap_channels
from lfa.deploy.recording.mcap_writer import ChunkWriter
from lfa.deploy.recording.said_again import HEARD, SaidAgain
from lfa.deploy.recording.sender_caps import SenderCaps
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.team import Event
from lfa.protocol.names import robot_id_of
from lfa.protocol.output import AppendedFile, write_line
from lfa.protocol.topics import OPERATOR_NAME, RECORDER_NAME, WORLD_NAME

RECORDING = "recording.mcap"
PART = "recording-{}.mcap"
"""Name of the second and later files of a recording in several files."""
EVENTS = "events.jsonl"
HOLES_NAMED = 3
TIME_S_MAX = 2.0**31 - 1.0
"""Latest time [s] of a message, that which ROS can say: 68 years."""
FLUSH_S = 1.0  # interval between flushes, the most that a SIGKILL of the recorder loses
ONLOOKERS = (WORLD_NAME, OPERATOR_NAME, RECORDER_NAME)
CHUNK_BYTES_MAX = 4 * 1024 * 1024

_line_encoder = msgspec.json.Encoder(order="deterministic")


class Recording(Struct, kw_only=True):
    """Size of a recording, and number of lost messages."""

    messages: int
    files: int
    bytes: int
    missing: int = 0
    """Number of messages that never arrived, from gaps in the senders' sequence numbers."""
    dropped: int = 0
    """Number of messages dropped because the recorder's inbox was full."""
    undecodable: int = 0
    unwritten: int = 0
    """Number of messages that the disk refused."""
    left_out: dict[str, int] = {}
    """Number of messages of each member above what one may add to a recording (`sender_caps.py`)."""
    holes: list[Hole] = []
    """Streams with gaps beyond what the topic may lose, the widest first."""

    def losses(self) -> list[str]:
        """Return a line for each reason why messages are not in the recording; short gaps of states are none."""
        counts = {
            f"never arrived{_widest(self.holes)}": sum(hole.missing for hole in self.holes),
            "dropped, the recorder was too slow": self.dropped,
            "refused by the disk": self.unwritten,
            **{f"of {name}, above the cap on one member": count for name, count in self.left_out.items()},
        }
        return [f"not recorded: {count} messages {reason}" for reason, count in counts.items() if count]


class Hole(Struct):
    """Messages of one stream that are missing in a recording, between two times [s] of the run."""

    stream: str
    """Owner and topic, as `robot2/pose`."""
    missing: int
    from_s: float
    until_s: float


def _widest(holes: list[Hole]) -> str:
    """Return the times [s] and the widest of the holes as text."""
    if not holes:
        return ""
    from_s, until_s = min(hole.from_s for hole in holes), max(hole.until_s for hole in holes)
    named = ", ".join(f"{hole.stream} {hole.missing}" for hole in holes[:HOLES_NAMED])
    return f", between {from_s:.1f} and {until_s:.1f} s: {named}{', ...' if len(holes) > HOLES_NAMED else ''}"


def parts(folder: Path) -> list[Path]:
    """Return the files of the recording in `folder`, oldest first; empty when there is none."""
    first, later = folder / RECORDING, folder.glob(PART.format("*"))
    return [first, *sorted(later)] if first.is_file() else []


class Recorder:
    """Writer of both files: every message goes to the recording, and an Event also to a line of the event log.

    With `split_bytes` the recording continues in a new file once a file has that size. `keep` files are retained
    (0: all): the first, which contains the mission, and the newest.
    """

    def __init__(self, folder: Path, about: dict[str, str], *, split_bytes: int = 0, keep: int = 0) -> None:
        """Open both files; `about` (scenario, fleet, mode, seed) is written to the recording. Raises OSError."""
        self._folder = folder
        self._about = about
        self._split_bytes = split_bytes
        self._keep = keep
        self._number = 0
        self._bytes = 0
        self._messages = 0
        self._flushed_at = 0.0
        self._caps = SenderCaps()
        self._unwritten = 0
        self._refused = ""
        """Why the disk took no message at the last attempt; empty: it took all."""
        self._lines = EventLines()
        self._events = AppendedFile(folder / EVENTS, fresh=True)
        reason = self._next_file()
        if reason:
            self._events.close()
            raise OSError(ENOSPC, reason, str(folder))

    def record(self, t: float, key: str, message: Message) -> None:
        """Record `message`, sent on `key` at `t` [s] since the run's start; `t` is kept in [0, TIME_S_MAX]."""
        t = min(t, TIME_S_MAX) if t > 0.0 else 0.0  # a foreign key may say any time; nan is 0
        allowance = self._caps.admits(t, key)
        if allowance is None:
            return
        channel = self._channels.get(key)
        if channel is None:
            channel = self._channels[key] = self._open_channel(key, type(message))
        stamp_ns = round(t * 1e9)
        body = mcap_channels.encode(message)
        self._writer.add_message(channel, stamp_ns, body, stamp_ns, message.header.seq)
        self._messages += 1
        allowance.left -= len(body)
        if type(message) in HEARD:
            line = self._lines.lines(t, key, message)
            if line:
                self._events.append(line)
                allowance.left -= len(line)
        if t >= self._flushed_at + FLUSH_S:
            self.flush_when_due(t)

    def flush_when_due(self, t: float) -> None:
        """Close the chunk every FLUSH_S, so that everything before is readable even if this process dies."""
        if t >= self._flushed_at + FLUSH_S:
            self._flushed_at = t
            before = self._writer.unwritten
            self._writer.flush()
            self._report("" if self._writer.unwritten == before else self._file.error)
            if 0 < self._split_bytes <= self._file.size:
                self._next_file()

    def close(self) -> Recording:
        """Finish both files and return the size of the recording."""
        self._finish_file()
        self._events.close()
        messages = self._messages - self._unwritten
        recording = Recording(messages=messages, files=self._number, bytes=self._bytes, unwritten=self._unwritten)
        recording.left_out = self._caps.left_out
        return recording

    def _report(self, reason: str) -> None:
        """Print a line when the disk begins to refuse messages, and when it takes them again."""
        if bool(reason) != bool(self._refused):
            text = f"{reason}: messages are lost until there is room" if reason else "there is room again: goes on"
            write_line(f"{self._file.path}: {text}", sys.stderr)
        self._refused = reason

    def _next_file(self) -> str:
        """Go on in a new file, readable without the others; return why not, and stay in the old one, if any."""
        name = RECORDING if self._number == 0 else PART.format(f"{self._number + 1:04}")
        try:
            file = AppendedFile(self._folder / name, fresh=True)
        except OSError as error:
            return error.strerror or str(error)
        writer = ChunkWriter(file, CHUNK_BYTES_MAX)
        if not writer.start(profile="", library="lfa"):
            file.close()
            return file.error
        writer.add_metadata("run", self._about)
        if self._number:
            self._finish_file()
        self._number += 1
        self._file, self._writer = file, writer
        self._channels: dict[str, int] = {}
        self._schemas: dict[type, int] = {}
        if 0 < self._keep < self._number:
            with suppress(OSError):
                (self._folder / PART.format(f"{self._number - self._keep + 1:04}")).unlink(missing_ok=True)
        return ""

    def _finish_file(self) -> None:
        self._writer.finish()
        self._unwritten += self._writer.unwritten
        self._bytes += self._file.size
        self._file.close()

    def _open_channel(self, key: str, kind: type) -> int:
        """Register the channel of a key: `lfa/<fleet>/robot1/pose` is recorded as `/robot1/pose`."""
        schema = self._schemas.get(kind)
        if schema is None:
            schema = self._writer.register_schema(f"lfa.{kind.__name__}", "jsonschema", mcap_channels.schema(kind))
            self._schemas[kind] = schema
        return self._writer.register_channel("/" + key.split("/", 2)[2], "json", schema)


class EventLines:
    """Lines of events.jsonl that the messages of a run make, those of events that nobody heard included."""

    def __init__(self) -> None:
        self._said = SaidAgain()

    def lines(self, t: float, key: str, message: Message) -> bytes:
        """Return the lines that `message`, sent on `key` at `t` [s], adds."""
        if type(message) not in HEARD:
            return b""
        line = event_line(t, message) if isinstance(message, Event) else b""
        return line + b"".join(event_line(t, event) for event in self._said.late(key, message))


def event_line(t: float, event: Event) -> bytes:
    """Return one line of events.jsonl: time [s], robot, term, kind, sender (`from`), and the event's data.

    World, operator and recorder report on other processes: their data may set `robot` and `t`.
    """
    data = mcap_channels.plain(event.data)
    sender = event.header.sender
    said = data if sender in ONLOOKERS else {}
    at_s = said.get("t", t)
    head = {
        "t": round(at_s if isinstance(at_s, int | float) else t, 6),
        "robot": said.get("robot", robot_id_of(sender)),
        "term": None if event.term is None else msgspec.structs.astuple(event.term),
        "kind": event.kind,
        "from": sender,
    }
    rest = {name: value for name, value in data.items() if name not in head}
    tail = b"," + _line_encoder.encode(rest)[1:] if rest else b"}"
    return msgspec.json.encode(head)[:-1] + tail + b"\n"
