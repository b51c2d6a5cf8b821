"""Record of a run as messages: who sent what, by sender and sequence number, and who received it.

The recorder hears every message without radio, so a message in the recording and not in a process's journal was lost on
the way there. Each process stamps with its own clock; the least delay from a stamp to its recording places that clock
on the run's time, within the delay of a message. So the journals of several machines share one time.
"""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

import msgspec
from msgspec import Struct

from lfa.deploy.recording import mcap_reader
from lfa.deploy.recording.run_folder import JOURNALS
from lfa.protocol.errors import Refused
from lfa.protocol.messages.header import Header
from lfa.protocol.node import Local, PeerDown, Stop
from lfa.protocol.runtime import journal
from lfa.protocol.topics import TO_ALL, TO_HELLO, TOPIC, TRUTH_OWNER, WORLD_NAME, address

COUNTED = ("lease", "table")
"""Topics on which a receiver journals each message, so that a missing number is a lost message."""
WATCHED = ("sensors", "localization", "scan", "ground")
"""Topics of a robot's hardware."""
STALL_S = 0.25
"""Least time [s] without a tick that counts as standing still: five times the deadman of the slowest profile."""
Sender = tuple[str, int]
"""Name and incarnation of a process."""
Number = tuple[str, int]
"""Topic and sequence number of a message of one sender."""


class SentMessage(Struct, frozen=True, gc=False):
    """One message as recorded: its number, its receiver (empty: all) and the time [s] of the run."""

    number: Number
    to: str
    at_s: float


class ProcessTrace(Struct):
    """What one incarnation of a process did, from its journal; times [s] of the run."""

    name: str
    incarnation: int
    ticks_s: list[float] = []
    first_s: float = 0.0
    last_s: float = 0.0
    """Time of the last call in the journal."""
    stopped_s: float | None = None
    """Time of the order to end (SIGTERM); None: it got none."""
    received: dict[Sender, set[Number]] = {}
    vanished: list[tuple[float, str, int]] = []
    """Liveliness tokens seen to vanish: time, name, incarnation."""


class RunTrace(Struct):
    """All processes of a run, and all messages that its recorder heard."""

    sent: dict[Sender, list[SentMessage]]
    """Messages on the `COUNTED` topics, in the order of their recording."""
    last: dict[Sender, SentMessage]
    """Last message of each sender. Those of the lease do not count: a robot's gateway answers in the robot's name."""
    hardware: dict[tuple[str, str], list[float]]
    """Times [s] of the messages of a robot's hardware, by robot and topic."""
    truth_s: list[float]
    """Times [s] of the ground truth; a gap in them is a world that stood still."""
    processes: list[ProcessTrace]
    end_s: float


class _RecordedHeader(Struct, frozen=True, gc=False):
    """Header in the recording, where structs are objects."""

    sender: str
    incarnation: int
    seq: int
    stamp: float


class _RecordedBody(Struct, frozen=True, gc=False):
    type: str = ""


class _RecordedMessage(Struct, frozen=True, gc=False):
    header: _RecordedHeader
    body: _RecordedBody = _RecordedBody()
    """Body of a lease message; empty on the other topics."""


class _Journalled(Struct, array_like=True, frozen=True, gc=False):
    tag: str
    header: Header


def read(folder: Path, end_s: float) -> RunTrace:
    """Return the messages of the run in `folder`, up to its end at `end_s` [s].

    Raises Refused without journals, and for a recording or a journal that cannot be read.
    """
    paths = sorted((folder / JOURNALS).glob("*.bin"))
    if not paths:
        raise Refused(f"{folder}: no journals, must be a run folder of lfa run or lfa sim")
    trace = RunTrace({}, {}, {}, [], [], end_s)
    offsets = _recording(folder, trace)
    trace.processes = [_process(path, offsets) for path in paths]
    return trace


def _recording(folder: Path, trace: RunTrace) -> dict[Sender, float]:
    """Fill in what was recorded; return what is to be added to each sender's stamps to get the run's time [s]."""
    decoder = msgspec.json.Decoder(_RecordedMessage)
    offsets: dict[Sender, float] = {}
    sent: defaultdict[Sender, list[SentMessage]] = defaultdict(list)
    hardware: defaultdict[tuple[str, str], list[float]] = defaultdict(list)
    for channel, t, body in mcap_reader.recorded(folder, frozenset(TOPIC)):
        _, owner, topic, *to = channel.split("/")
        try:
            message = decoder.decode(body)
        except (msgspec.DecodeError, ValueError, RecursionError) as error:
            raise Refused(f"{folder}: recorded by another program or version, {channel}: {error}") from None
        header = message.header
        sender = (header.sender, header.incarnation)
        offsets[sender] = min(offsets.get(sender, float("inf")), t - header.stamp)
        if topic != "lease":
            trace.last[sender] = SentMessage((topic, header.seq), "", t)
        if topic in COUNTED and message.body.type != "fenced":  # that is a gateway, with numbers of its own
            to_name = "" if not to or to[0] in (TO_ALL, TO_HELLO) else to[0]
            sent[sender].append(SentMessage((topic, header.seq), to_name, t))
        elif topic in WATCHED:
            hardware[owner, topic].append(t)
        elif owner == TRUTH_OWNER and topic == "truth":
            trace.truth_s.append(t)
    trace.sent, trace.hardware = dict(sent), dict(hardware)
    return offsets


_local_decoder = msgspec.msgpack.Decoder(Local)
_journalled_decoder = msgspec.msgpack.Decoder(_Journalled)


def _process(path: Path, offsets: dict[Sender, float]) -> ProcessTrace:
    """Return the trace in one journal. Raises Refused for a damaged one."""
    try:
        heading, entries = journal.read(path)
    except (OSError, ValueError) as error:
        raise Refused(f"{path}: cannot be read ({error})") from None
    offset_s = offsets.get((heading.node, heading.incarnation), offsets.get((WORLD_NAME, 1), 0.0))
    trace = ProcessTrace(heading.node, heading.incarnation)
    begun = False
    for entry in entries:
        at_s = entry.at + offset_s
        if not begun:
            begun, trace.first_s = True, at_s
        trace.last_s = max(trace.last_s, at_s)
        match entry.kind:
            case "tick":
                trace.ticks_s.append(at_s)
            case "local":
                _local(trace, entry.payload, at_s)
            case _:
                _message(trace, entry.key, entry.payload)
    return trace


def _local(trace: ProcessTrace, payload: bytes, at_s: float) -> None:
    match _local_decoder.decode(payload):
        case PeerDown(name, incarnation):
            trace.vanished.append((at_s, name, incarnation))
        case Stop():
            trace.stopped_s = at_s


def _message(trace: ProcessTrace, key: str, payload: bytes) -> None:
    where = address(key)
    if where is None or where.topic not in COUNTED:
        return
    try:
        header = _journalled_decoder.decode(payload).header
    except (msgspec.DecodeError, ValueError, RecursionError):
        return
    trace.received.setdefault((header.sender, header.incarnation), set()).add((where.topic, header.seq))
