"""What a recording and the journals of the same run say of the same messages."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
from mcap.reader import make_reader

from lfa.deploy.analysis.verification import reexecution
from lfa.deploy.recording import mcap_channels
from lfa.deploy.recording.recorder import parts
from lfa.protocol.messages.codec import decode
from lfa.protocol.runtime import journal
from lfa.protocol.runtime.journal import Journal
from lfa.protocol.runtime.node_host import NodeHost
from lfa.protocol.topics import TOPIC, address

Stream = tuple[str, str, int]
"""A channel, and one life of one sender on it."""
Ends = dict[Stream, tuple[Any, Any]]


def _noted(ends: Ends, channel: str, body: bytes) -> None:
    message = msgspec.json.decode(body)
    stream = (channel, message["header"]["sender"], message["header"]["incarnation"])
    ends[stream] = (ends.get(stream, (message,))[0], message)


def recorded_ends(folder: Path) -> Ends:
    """First and last message of each stream, as the `mcap` library reads them."""
    ends: Ends = {}
    for path in parts(folder):
        with path.open("rb") as stream:
            for _, channel, message in make_reader(stream).iter_messages(log_time_order=False):
                _noted(ends, channel.topic, message.data)
    return ends


def journalled_ends(folder: Path) -> Ends:
    """The same, from the journals: each core run again, and what it said."""
    ends: Ends = {}
    for path in sorted((folder / "journal").glob("*.bin")):
        heading, entries = journal.read(path)
        host = NodeHost(reexecution.node_of(path, heading), Journal(None, heading))
        for entry in entries:
            for to, payload in reexecution.call(host, entry):
                where = address(to)
                assert where is not None
                _noted(ends, "/" + to.split("/", 2)[2], mcap_channels.encode(decode(payload, TOPIC[where.topic].type)))
    return ends


def differing(folder: Path, killed: tuple[str, ...] = ()) -> list[Stream]:
    """Streams of which the two tell another first or last message, or one of them none.

    What a process said in its last step before SIGKILL may be recorded and no more journalled: of these only the first.
    """
    recorded, journalled = recorded_ends(folder), journalled_ends(folder)
    own = {stream for stream in recorded if stream[1] not in ("operator", "recorder")}
    ends = {stream: 1 if stream[1] in killed else 2 for stream in own | set(journalled)}
    return sorted(s for s, n in ends.items() if recorded.get(s, ())[:n] != journalled.get(s, ())[:n])
