"""`lfa record`: record a running fleet, however it was started, until Ctrl-C or SIGTERM."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from math import inf
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from lfa.deploy.analysis.summarize import summarize
from lfa.deploy.analysis.summary import Summary
from lfa.deploy.analysis.summary import write as write_summary
from lfa.deploy.analysis.summary_table import text
from lfa.deploy.client.operator import Operator
from lfa.deploy.client.session import FleetAddress, Subscriber, find, listen, world_of_fleet
from lfa.deploy.fleet.plan.fleet_file import load
from lfa.deploy.fleet.remote import journals
from lfa.deploy.process.signals import Interrupts
from lfa.deploy.recording.holes import Holes
from lfa.deploy.recording.outcome import Verdict
from lfa.deploy.recording.provenance import provenance
from lfa.deploy.recording.recorder import Recorder, Recording
from lfa.deploy.recording.run_folder import RUNS, SCENARIO, About, make, toml
from lfa.deploy.recording.simulation_time import WorldTime
from lfa.deploy.run.termination import Termination
from lfa.deploy.terminal_text import print_visible
from lfa.protocol import clock, incarnations
from lfa.protocol.errors import Refused
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.simulation import Truth
from lfa.protocol.messages.team import MissionNote
from lfa.protocol.mission import Mission
from lfa.protocol.output import write_line
from lfa.protocol.transport.message_bus import send
from lfa.world.description.load import Scenario

POLL_S = 0.05
SPLIT_MB = 256.0
NEED_TRUTH = (
    "goal_reached", "distance_error_max_m", "distance_error_rms_m", "bearing_error_rms_rad", "settled_within_s",
    "contacts_max", "separation_min_m", "left_behind_max",
)  # fmt: skip
"""Assertions about what only ground truth shows."""


def command(
    fleet: Annotated[str | None, typer.Option(help="Name of the fleet, when several run here.")] = None,
    connect: Annotated[
        str | None, typer.Option(help="Endpoint of another router than the fleet's own on this machine.")
    ] = None,
    keys: Annotated[Path | None, typer.Option(help="Folder of lfa keys, for a secured fleet.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder. Default: runs/<fleet>-<time>.")] = None,
    seconds: Annotated[float, typer.Option(help="Duration of the recording [s]; 0: no limit.")] = 0.0,
    split_mb: Annotated[
        float, typer.Option(help="Size of a file [MB] at which a new one is started; 0: never.")
    ] = SPLIT_MB,
    keep: Annotated[int, typer.Option(help="Number of files to keep, the first and the newest; 0: all.")] = 0,
    hosts: Annotated[Path | None, typer.Option(help="Fleet file: also copy the journals of its machines.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> int:
    if not 0.0 <= seconds < inf:
        raise Refused(f"--seconds {seconds:g}: must be above 0, or 0 for no end")
    if not split_mb >= 0.0 or keep < 0:
        raise Refused(f"--split-mb {split_mb:g} --keep {keep}: must be 0 or more")
    plan = None if hosts is None else load(hosts)
    found = find(fleet, connect, keys)
    with listen(found, frozenset({"**"}), every=True) as subscriber, Interrupts() as interrupts:
        followed = _Followed(found, out, round(1e6 * split_mb), keep)
        kept = journals.of_processes(found.name)
        write_line(f"records fleet {found.name} into {followed.folder}", sys.stderr if as_json else sys.stdout)
        recording = followed.record(subscriber, interrupts, seconds)
    came, wrong = 0, list[str]()
    try:
        came = journals.copy(kept | journals.of_processes(found.name), followed.folder)
    except OSError as error:
        wrong.append(f"{error.filename}: {error.strerror}: the journals are not kept there")
    if plan is not None:
        fetched, failed = journals.fetch(plan, followed.folder)
        came, wrong = came + fetched, wrong + failed
    summary = followed.summarize(recording)
    for line in (*wrong, *recording.losses()):
        print_visible(f"lfa: {line}", file=sys.stderr)
    if as_json:
        facts = {"folder": str(followed.folder), "fleet": found.name, "journals": came, "summary": summary}
        print_visible(msgspec.json.encode({**facts, **msgspec.to_builtins(recording)}).decode())
    else:
        print_visible("\n".join(_lines(followed.folder, recording, came, summary)))
    whole = recording.messages and not recording.dropped and not recording.unwritten
    return 1 if not whole else 0 if as_json or summary is None else summary.exit_code


def _lines(folder: Path, recording: Recording, came: int, summary: Summary | None) -> Iterator[str]:
    """Yield what a person is told of a recording with so many journals."""
    if summary is not None:
        yield text(summary, folder)
    files = f"{recording.files} file{'s' * (recording.files > 1)} of {recording.bytes / 1e6:.1f} MB"
    lost = recording.dropped + sum(hole.missing for hole in recording.holes)
    with_holes = ", with holes" if recording.holes else ""
    yield f"{recording.messages} messages, {lost} lost, {files}, {came} journals: {folder}{with_holes}"


def _name(scenario: Scenario, fleet: str) -> str:
    """Return the name of a recorded run's scenario: the fleet's, where its world runs a file of a run folder."""
    return fleet if scenario.name == Path(SCENARIO).stem else scenario.name


class _Followed:
    """Recording of a fleet, and what becomes of the fleet's run meanwhile."""

    def __init__(self, fleet: FleetAddress, out: Path | None, split_bytes: int, keep: int) -> None:
        """Create the run folder. Raises Refused."""
        world = world_of_fleet(fleet)
        self._scenario = world[0] if world else None
        name, seed = (_name(world[0], fleet.name), world[1]) if world else (fleet.name, 0)
        self.folder = _folder(fleet, out, self._scenario)
        self._about = About(name, "recorded", seed, fleet.name, provenance())
        self._recorder = Recorder(self.folder, self._about.metadata(), split_bytes=split_bytes, keep=keep)
        self._seen = WorldTime()
        self._begun = clock.now()
        self._lasted_s = 0.0
        self._mission: Mission | None = None
        self._holes = Holes()
        self._termination = None if self._scenario is None else Termination(self._scenario)

    def record(self, subscriber: Subscriber, interrupts: Interrupts, seconds: float) -> Recording:
        """Record for `seconds`, or without an end if these are 0, until a signal comes; return what was recorded."""
        send(subscriber.bus, Operator(self._about.fleet, incarnations.drawn()).ask("mission", self._begun))
        while interrupts.signal is None and not 0.0 < seconds <= clock.now() - self._begun:
            clock.sleep(POLL_S)
            self._write(subscriber)
        recording = self._recorder.close()
        self._lasted_s = clock.now() - self._begun
        recording.dropped = subscriber.dropped
        recording.missing, recording.holes = self._holes.missing, self._holes.widest()
        return recording

    def _write(self, subscriber: Subscriber) -> None:
        """Record all new messages, at world time [s], or without a world at the time since the recording's start."""
        for arrival, message in subscriber.take():
            self._see(message, arrival.at)
            at_s = self._seen.of(arrival.at) if self._seen.known else arrival.at - self._begun
            self._recorder.record(at_s, arrival.key, message)
            self._holes.see(at_s, arrival.key, message.header)

    def _see(self, message: Message, at: float) -> None:
        """Take what tells of the fleet's mission, its world's time and its end from a message that came at `at` [s]."""
        if isinstance(message, Truth):
            self._seen.see(at, message.time_s)
        elif isinstance(message, MissionNote):
            self._mission = message.whole
        if self._termination is not None:
            self._termination.see(message)

    def summarize(self, recording: Recording) -> Summary | None:
        """Write the summary of what was recorded and return it; None if not even the mission is known."""
        if self._scenario is None:
            if self._mission is None:
                return None
            limit_s = max(self._lasted_s, 1.0)
            fleet = Scenario(title=f"Fleet {self._about.fleet}", mission=self._mission, time_limit_s=limit_s)
            (self.folder / SCENARIO).write_text(toml(fleet), encoding="utf-8")
        verdict = (self._termination.verdict if self._termination is not None else None) or Verdict("recorded")
        summary = summarize(self.folder, self._about, verdict, self._lasted_s, ())
        summary.recording, summary.warnings = recording, recording.losses()
        if not self._seen.known:
            summary.warnings.append("no ground truth was heard: errors, contacts and separation are not known")
            summary.assertions = [one for one in summary.assertions if one.name not in NEED_TRUTH]
        write_summary(self.folder, summary)
        return summary


def _folder(fleet: FleetAddress, out: Path | None, scenario: Scenario | None) -> Path:
    """Create and return the folder; it contains the scenario (walls, obstacles) if the world runs on this machine."""
    path = out or RUNS / f"{fleet.name}-{time.strftime('%Y%m%d-%H%M%S')}"
    if scenario is not None:
        return make(path, scenario)
    try:
        path.mkdir(parents=True)
    except OSError as error:
        raise Refused(f"--out {path}: cannot be made ({error.strerror}), give a new place to write to") from None
    return path
