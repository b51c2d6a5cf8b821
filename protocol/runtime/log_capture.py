"""Log lines of a node's events, on standard error: for `lfa logs`, the system journal or a terminal.

A robot never waits for a reader: a line that cannot be written at once (stopped terminal, full pipe) is dropped.
"""

from __future__ import annotations

import contextlib
import os
import select
from typing import Any

import msgspec

from lfa.protocol.messages.codec import BadMessage, decode
from lfa.protocol.messages.team import Event

STDERR = 2
LINE_BYTES_MAX = 1000
"""Maximum length [bytes] of a line, below the size that a pipe writes atomically."""
EVENT_ENDING = "/event"
"""Last part of the keys that events are published on."""


def line(event: Event, wall_ms: int) -> str:
    """Return an event's log line: `21:44:15.123Z robot2 role leader=1 role=leader term=7763`, no newline."""
    seconds, ms = divmod(wall_ms % 86_400_000, 1000)
    at = f"{seconds // 3600:02}:{seconds // 60 % 60:02}:{seconds % 60:02}.{ms:03}Z"
    term = () if event.term is None or not event.term.n else (f"term={event.term.n}",)
    data = (f"{name}={_shown(value)}" for name, value in event.data.items())
    return " ".join((at, event.header.sender, event.kind, *data, *term))


def tell(payload: bytes, wall_ms: int, out: int = STDERR) -> None:
    """Write the log line of the event in `payload` to the file descriptor `out`; ignore other payloads."""
    try:
        event = decode(payload, Event)
    except BadMessage:
        return
    text = line(event, wall_ms).encode(errors="replace")[:LINE_BYTES_MAX] if isinstance(event, Event) else b""
    with contextlib.suppress(OSError):
        poll = select.poll()
        poll.register(out, select.POLLOUT)
        if text and [what for _, what in poll.poll(0) if what == select.POLLOUT]:
            os.write(out, text + b"\n")


def _shown(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, str):
        return value
    return msgspec.json.encode(value).decode()
