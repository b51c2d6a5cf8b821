"""`lfa bench look`: cost of observing a running team of four at full rates.

Measured are shares of a core, the effect on the agents' loop lag, size and creation time of the files of a two-minute
run, and the response time of `lfa --help`.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import termios
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from socket import socket

import msgspec
from msgspec.structs import replace

from lfa.deploy.bench.harness.child_process import LFA, cpu_s, pause, started
from lfa.deploy.bench.harness.rows import BenchRow, Quantity, row, show
from lfa.deploy.bench.harness.team import Team, endless
from lfa.deploy.client.session import FleetAddress, Subscriber, listen
from lfa.deploy.recording.outcome import Verdict
from lfa.deploy.recording.run_folder import About, make
from lfa.deploy.run import simulate
from lfa.deploy.run.recorder_process import RecorderTask, RunResult
from lfa.deploy.view.report import command
from lfa.deploy.view.rerun.command import converted
from lfa.protocol import clock
from lfa.protocol.messages.team import Status

ROBOTS = 4
SETTLE_S = 5.0
WATCHED_S = 20.0
RUN_S = 120.0
STARTS = 9
MB = 1e6


def run(as_json: bool) -> int:
    """Print the rows; return 0 if all hold, else 1."""
    return show(_rows(), as_json)


def _rows() -> Iterator[list[BenchRow]]:
    yield _help()
    with Team(endless(ROBOTS)) as team, tempfile.TemporaryDirectory() as place:
        team.await_chain(ROBOTS)
        pause(team, SETTLE_S)
        with listen(team.fleet, frozenset({"*/status"}), every=True) as subscriber:
            alone = _lags(team, subscriber, WATCHED_S)
            yield _recorder(team, Path(place))
            yield _watch(team)
            with started([*LFA, *_view(team.fleet)]) as viewer:
                pause(team, SETTLE_S)
                subscriber.take()
                before, since = cpu_s(viewer), clock.now()
                watched = _lags(team, subscriber, WATCHED_S)
                share = 100.0 * (cpu_s(viewer) - before) / (clock.now() - since)
    yield [row("viewer bridge", Quantity("share of a core", "%", 10.0), share)]
    yield [
        row("loop lag", Quantity("median without a viewer", "ms"), alone),
        row("loop lag", Quantity("median with a viewer", "ms", max(1.25 * alone, alone + 0.5)), watched),
    ]
    yield from _files()


def _help() -> list[BenchRow]:
    """Measure `lfa --help` against a bare start of the interpreter, to separate a slow machine from a slow command."""
    bare = statistics.median(_took([sys.executable, "-c", "pass"]) for _ in range(STARTS))
    help_s = statistics.median(_took([*LFA, "--help"]) for _ in range(STARTS))
    return [
        row("help", Quantity("a bare start", "s"), bare),
        row("help", Quantity("lfa --help", "s", 0.3), help_s),
        row("help", Quantity("times a bare start", "1", 10.0), help_s / bare),
    ]


def _recorder(team: Team, place: Path) -> list[BenchRow]:
    """Measure the recorder process of `lfa run` on this team."""
    folder = make(place / "run", team.scenario)
    task = RecorderTask(
        str(folder), About("endless", "bench", 0, team.fleet.name), team.fleet.endpoint, str(place / "none")
    )
    words = [sys.executable, "-P", "-m", "lfa.deploy.run.recorder_process", msgspec.json.encode(task).decode()]
    with started(words, stdin=subprocess.PIPE) as process:
        pause(team, SETTLE_S)
        before, since = cpu_s(process), clock.now()
        pause(team, WATCHED_S)
        share = 100.0 * (cpu_s(process) - before) / (clock.now() - since)
        process.communicate(msgspec.json.encode(RunResult(Verdict("time_limit"), WATCHED_S, ())) + b"\n")
    kept = msgspec.json.decode((folder / "summary.json").read_bytes())["recording"]
    return [
        row("recorder", Quantity("share of a core", "%", 10.0), share),
        row("recorder", Quantity("messages a second", "1/s"), kept["messages"] / (WATCHED_S + SETTLE_S)),
        row("recorder", Quantity("lost", "messages", 0.0), float(kept["missing"] + kept["dropped"])),
    ]


def _watch(team: Team) -> list[BenchRow]:
    """Measure `lfa watch` on a pseudo-terminal of 80 columns."""
    terminal, inside = os.openpty()
    termios.tcsetwinsize(inside, (24, 80))
    threading.Thread(target=_drain, args=(terminal,), daemon=True).start()
    words = [*LFA, "watch", "--fleet", team.fleet.name, "--connect", team.fleet.endpoint]
    with started(words, inside, inside) as process:
        pause(team, SETTLE_S)
        before, since = cpu_s(process), clock.now()
        pause(team, WATCHED_S)
        share = 100.0 * (cpu_s(process) - before) / (clock.now() - since)
    os.close(inside)
    return [row("watch", Quantity("share of a core", "%", 5.0), share)]


def _drain(terminal: int) -> None:
    with contextlib.suppress(OSError):  # the other side was closed
        while os.read(terminal, 65536):
            pass


def _files() -> Iterator[list[BenchRow]]:
    """Measure size and creation time of the files of a two-minute run."""
    place = Path(tempfile.mkdtemp(prefix="lfa-"))
    try:
        folder = simulate.run(replace(endless(ROBOTS), time_limit_s=RUN_S), 1, place / "run").folder
        yield [row("two minutes", Quantity("mcap", "MB", 30.0), (folder / "recording.mcap").stat().st_size / MB)]
        since = clock.now()
        page = command.html([folder])
        yield [
            row("two minutes", Quantity("report", "MB", 3.0), len(page.encode()) / MB),
            row("two minutes", Quantity("report made in", "s", 10.0), clock.now() - since),
        ]
        since = clock.now()
        rrd = converted(folder)
        yield [
            row("two minutes", Quantity("rrd", "MB", 30.0), rrd.stat().st_size / MB),
            row("two minutes", Quantity("rrd made in", "s"), clock.now() - since),
        ]
    finally:
        shutil.rmtree(place, ignore_errors=True)


def _view(fleet: FleetAddress) -> list[str]:
    ports = []
    for _ in range(2):
        with socket() as free:
            free.bind(("127.0.0.1", 0))
            ports.append(str(free.getsockname()[1]))
    where = ["--port", ports[0], "--web-port", ports[1]]
    return ["view", "--fleet", fleet.name, "--connect", fleet.endpoint, "--serve-web", *where]


def _took(words: Sequence[str]) -> float:
    since = clock.now()
    subprocess.run(words, stdout=subprocess.DEVNULL, check=True)
    return clock.now() - since


def _lags(team: Team, subscriber: Subscriber, duration_s: float) -> float:
    """Return the median [ms] of the agents' loop lags, each the largest of one second."""
    subscriber.take()
    pause(team, duration_s)
    help_s = [message for _, message in subscriber.take() if isinstance(message, Status)]
    return statistics.median(status.counters["loop_lag_ms"] for status in help_s if "loop_lag_ms" in status.counters)
