"""Recorder without files: what the summary of a run is computed from, and nothing else.

A campaign of a thousand runs keeps no recordings. From the same messages the arrays and the event log come out as they
would after `recorder.py` and `mcap_reader.py`, so the summary is the same.
"""

from __future__ import annotations

from lfa.deploy.recording import event_log
from lfa.deploy.recording.event_log import Line
from lfa.deploy.recording.mcap_reader import RecordedRun, RunRows
from lfa.deploy.recording.recorder import Recording, event_line
from lfa.deploy.recording.said_again import SaidAgain
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.team import Event


class RunMemory:
    """Arrays and event log of one run, in memory."""

    def __init__(self) -> None:
        self._rows = RunRows()
        self._lines: list[bytes] = []
        self._said = SaidAgain()
        self._messages = 0

    def record(self, t: float, key: str, message: Message) -> None:
        """Keep what is needed of `message`, sent on `key` at `t` [s] since the run's start."""
        t = round(t * 1e9) / 1e9 if t > 0.0 else 0.0  # a recording counts nanoseconds
        self._messages += 1
        _, _, owner, topic, *_ = key.split("/", 4)
        if topic in RunRows.TOPICS:
            self._rows.add(owner, topic, t, message)
        if isinstance(message, Event):
            self._lines.append(event_line(t, message))
        self._lines += [event_line(t, event) for event in self._said.late(key, message)]

    def close(self) -> Recording:
        """Return the size of the recording: no file."""
        return Recording(messages=self._messages, files=0, bytes=0)

    def seen(self) -> RecordedRun:
        """Return the arrays of the run."""
        return self._rows.arrays()

    def events(self) -> list[Line]:
        """Return the event log of the run."""
        return event_log.in_order(self._lines)
