"""Comparison of a recording with the journals of the same run: first and last message of each stream."""

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
"""Channel, sender and the sender's incarnation."""
Ends = dict[Stream, tuple[Any, Any]]


def _noted(ends: Ends, channel: str, body: bytes) -> None:
    message = msgspec.json.decode(body)
    stream = (channel, message["header"]["sender"], message["header"]["incarnation"])
    ends[stream] = (ends.get(stream, (message,))[0], message)


def recorded_ends(folder: Path) -> Ends:
    """Return the first and last message of each stream, as read by the `mcap` library."""
    ends: Ends = {}
    for path in parts(folder):
        with path.open("rb") as stream:
            for _, channel, message in make_reader(stream).iter_messages(log_time_order=False):
                _noted(ends, channel.topic, message.data)
    return ends


def journalled_ends(folder: Path) -> Ends:
    """Return the first and last message of each stream, from a re-execution of the journals."""
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
    """Return the streams whose first or last message differs, or is missing, between recording and journals.

    Messages of a process's last step before SIGKILL may be recorded but not journalled, so for `killed` processes only
    the first message is compared.
    """
    recorded, journalled = recorded_ends(folder), journalled_ends(folder)
    own = {stream for stream in recorded if stream[1] not in ("operator", "recorder")}
    ends = {stream: 1 if stream[1] in killed else 2 for stream in own | set(journalled)}
    return sorted(s for s, n in ends.items() if recorded.get(s, ())[:n] != journalled.get(s, ())[:n])
