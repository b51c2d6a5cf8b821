"""Log lines of a node's events, on standard error: for `lfa logs`, the system journal or a terminal.

A robot never waits for a reader, and no reader can end it (`protocol/output.py`).
"""

from __future__ import annotations

import sys
from typing import Any, TextIO

import msgspec

from lfa.protocol.messages.team import Event
from lfa.protocol.output import write_line
from lfa.protocol.topics import message_in

LINE_CHARACTERS_MAX = 1000
EVENT_ENDING = "/event"
"""Last part of the keys that events are published on."""


def line(event: Event, wall_ms: int) -> str:
    """Return an event's log line: `21:44:15.123Z robot2 role leader=1 role=leader term=7763`, no newline."""
    seconds, ms = divmod(wall_ms % 86_400_000, 1000)
    at = f"{seconds // 3600:02}:{seconds // 60 % 60:02}:{seconds % 60:02}.{ms:03}Z"
    term = () if event.term is None or not event.term.n else (f"term={event.term.n}",)
    data = (f"{name}={_shown(value)}" for name, value in event.data.items())
    return " ".join((at, event.header.sender, event.kind, *data, *term))


def tell(key: str, payload: bytes, wall_ms: int, stream: TextIO | None = None) -> None:
    """Write the log line of the event in `payload` to `stream`, by default standard error; ignore other payloads."""
    event = message_in(key, payload)
    if isinstance(event, Event):
        write_line(line(event, wall_ms)[:LINE_CHARACTERS_MAX], sys.stderr if stream is None else stream)


def _shown(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, str):
        return value
    return msgspec.json.encode(value).decode()
