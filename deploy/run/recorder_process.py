"""The recorder process: records all messages of one fleet and closes the run folder, whichever process dies.

The launcher writes to its standard input. One line of JSON there is the verdict. An end of file without a line means
that the launcher died: the run is then aborted, and this process cleans up in its place. Start:
`python -m lfa.deploy.run.recorder_process TASK`, with a `RecorderTask` as JSON.
"""

from __future__ import annotations

import lfa.protocol.program_start.installed_first  # noqa: F401 (before any other module)

# isort: split
import shutil
import signal
import sys
import threading
from pathlib import Path

import msgspec
from msgspec import Struct

from lfa.deploy.client.operator import Operator
from lfa.deploy.recording.holes import Holes
from lfa.deploy.recording.outcome import Verdict
from lfa.deploy.recording.recorder import Recorder, Recording
from lfa.deploy.recording.run_folder import About
from lfa.deploy.recording.simulation_time import WorldTime
from lfa.deploy.run.finish import finish
from lfa.protocol import clock, incarnations
from lfa.protocol.messages.simulation import Truth
from lfa.protocol.names import robot_id_of
from lfa.protocol.node import Envelope, PeerDown, PeerUp
from lfa.protocol.outbox import Outbox
from lfa.protocol.output import write_line
from lfa.protocol.topics import RECORDER_NAME, alive_key
from lfa.protocol.transport.bus import Arrival, Inbox, Wake
from lfa.protocol.transport.links import Links
from lfa.protocol.transport.message_bus import Decoder
from lfa.protocol.transport.zenoh_bus import ZenohBus

INBOX_SIZE_MAX = 65536  # one minute of a fleet of four, in case the disk is slow
WAIT_S = 0.05
LAST_WORDS_S = 0.2  # for messages in transit when the verdict arrives


class RecorderTask(Struct, frozen=True):
    """Task of the recorder: run folder, fleet, endpoint, and the folder of sockets to remove if the launcher dies."""

    folder: str
    about: About
    endpoint: str
    sockets: str


class RunResult(Struct, frozen=True):
    """Result of a run, as the launcher sends it."""

    verdict: Verdict
    duration_s: float
    faults_left: tuple[str, ...]


def main() -> None:
    """Record until a line, an end of file, or a signal arrives, then close the run folder."""
    task = msgspec.json.decode(sys.argv[1], type=RecorderTask)
    stop = Wake()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    word: list[RunResult] = []
    threading.Thread(target=_listen, args=(word, stop), daemon=True).start()
    tape = _Tape(task)
    begun = clock.now()
    while not stop.wait(WAIT_S):
        tape.drain()
    if word:
        clock.sleep(LAST_WORDS_S)
    tape.drain()
    last = word[0] if word else RunResult(Verdict("aborted", "the launcher died"), clock.now() - begun, ())
    recording = tape.close(last.verdict)
    if not word:
        shutil.rmtree(task.sockets, ignore_errors=True)
    try:
        finish(Path(task.folder), task.about, last.verdict, last.duration_s, last.faults_left, None, recording)
    except OSError as error:
        write_line(f"{error.filename or task.folder}: {error.strerror}: there is no summary", sys.stderr)
        sys.exit(1)


def _listen(word: list[RunResult], stop: Wake) -> None:
    """Wait for the launcher's line or the end of its output."""
    line = sys.stdin.buffer.readline()
    if line.endswith(b"\n"):
        word.append(msgspec.json.decode(line, type=RunResult))
    stop.set()


class _Tape:
    """Connection of the bus to the recorder."""

    def __init__(self, task: RecorderTask) -> None:
        fleet = task.about.fleet
        self._inbox = Inbox(size_max=INBOX_SIZE_MAX, every=True)
        self._incarnation = incarnations.drawn()
        self._outbox = Outbox(fleet, RECORDER_NAME, self._incarnation, first=1)
        self._decoder = Decoder()
        self._holes = Holes()
        self._links = Links()
        self._time = WorldTime()
        self._operator = Operator(fleet, self._incarnation)
        self._recorder = Recorder(Path(task.folder), task.about.metadata())
        self._bus = ZenohBus(task.endpoint, self._inbox)
        self._bus.follow(frozenset({f"lfa/{fleet}/**", alive_key(fleet, "*", "*")}))
        self._bus.announce(fleet, RECORDER_NAME, self._incarnation)

    def drain(self) -> None:
        """Record all pending messages."""
        now = clock.now()
        for arrival in self._inbox.take():
            if not isinstance(arrival.payload, bytes):
                self._links.see(arrival.payload, now)
            heard = self._heard(arrival)
            if heard is None:
                continue
            where, message = heard.key, heard.message
            if isinstance(message, Truth):
                self._time.see(arrival.at, message.time_s)
            self._recorder.record(self._time.of(arrival.at), where, message)
            self._holes.see(self._time.of(arrival.at), where, message.header)
        if self._links.due(now):
            self._bus.resubscribe()
        self._recorder.flush_when_due(self._time.of(clock.now()))

    def close(self, verdict: Verdict) -> Recording:
        """Record the end of the run, close recorder and bus, and return the counts."""
        now = clock.now()
        end = self._operator.event("end", now, outcome=verdict.outcome, reason=verdict.reason)
        self._recorder.record(self._time.of(now), end.key, end.message)
        recording = self._recorder.close()
        self._bus.close()
        recording.missing, recording.dropped = self._holes.missing, self._inbox.dropped
        recording.holes = self._holes.widest()
        recording.undecodable = self._decoder.undecodable
        lost = f"{recording.missing} missing, {recording.dropped} dropped, {recording.unwritten} refused by the disk"
        write_line(f"{recording.messages} recorded, {recording.undecodable} undecodable, {lost}", sys.stdout)
        for line in recording.losses():
            write_line(line, sys.stderr)
        return recording

    def _heard(self, arrival: Arrival) -> Envelope | None:
        """Return key and message to record; a liveliness change becomes an event published by the recorder."""
        match arrival.payload:
            case PeerUp(name=name, incarnation=incarnation):
                return self._token("peer_up", name, incarnation)
            case PeerDown(name=name, incarnation=incarnation):
                return self._token("peer_down", name, incarnation)
        message = self._decoder.message(arrival)
        return None if message is None else Envelope(arrival.key, message)

    def _token(self, kind: str, name: str, incarnation: int) -> Envelope:
        data = {"robot": robot_id_of(name), "name": name, "incarnation": incarnation}
        return self._outbox.event_envelope(kind, clock.now(), None, data)


if __name__ == "__main__":
    main()
