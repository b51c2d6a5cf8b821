"""`lfa record`: record a running fleet, however it was started, until Ctrl-C or SIGTERM."""

from __future__ import annotations

import sys
import time
from math import inf
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from lfa.deploy.client.session import FleetAddress, Subscriber, find, listen, scenario_of_fleet
from lfa.deploy.fleet.plan.fleet_file import load
from lfa.deploy.fleet.remote import journals
from lfa.deploy.process.signals import Interrupts
from lfa.deploy.recording.holes import Holes
from lfa.deploy.recording.recorder import Recorder
from lfa.deploy.recording.run_folder import RUNS, About, make
from lfa.deploy.recording.simulation_time import WorldTime
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.messages.simulation import Truth
from lfa.protocol.output import write_line

POLL_S = 0.05
SPLIT_MB = 256.0


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
    with listen(found, frozenset({"**"}), every=True) as ear, Interrupts() as interrupts:
        folder = _folder(found, out)
        about = About(found.name, "onlooker", 0, found.name).metadata()
        recorder = Recorder(folder, about, split_bytes=round(1e6 * split_mb), keep=keep)
        kept = journals.of_processes(found.name)
        write_line(f"records fleet {found.name} into {folder}", sys.stderr if as_json else sys.stdout)
        begun, seen, holes = clock.now(), WorldTime(), Holes()
        while interrupts.signal is None and not 0.0 < seconds <= clock.now() - begun:
            clock.sleep(POLL_S)
            _write(ear, recorder, seen, holes, begun)
        recording = recorder.close()
    came = journals.copy(kept | journals.of_processes(found.name), folder)
    if plan is not None:
        fetched, wrong = journals.fetch(plan, folder)
        came += fetched
        for line in wrong:
            print(f"lfa: {line}", file=sys.stderr)
    recording.dropped, recording.missing, recording.holes = ear.dropped, holes.missing, holes.widest()
    code = 0 if recording.messages and not recording.dropped and not recording.unwritten else 1
    for line in recording.losses():
        print(f"lfa: {line}", file=sys.stderr)
    if as_json:
        facts = {"folder": str(folder), "fleet": found.name, "journals": came}
        print(msgspec.json.encode({**facts, **msgspec.to_builtins(recording)}).decode())
        return code
    files = f"{recording.files} file{'s' * (recording.files > 1)} of {recording.bytes / 1e6:.1f} MB"
    lost = recording.dropped + sum(hole.missing for hole in recording.holes)
    with_holes = ", with holes" if recording.holes else ""
    print(f"{recording.messages} messages, {lost} lost, {files}, {came} journals: {folder}{with_holes}")
    return code


def _write(ear: Subscriber, recorder: Recorder, seen: WorldTime, holes: Holes, begun: float) -> None:
    """Record all new messages, at world time [s], or without a world at the time since the recording's start."""
    for arrival, message in ear.take():
        if isinstance(message, Truth):
            seen.see(arrival.at, message.time_s)
        at = seen.of(arrival.at) if seen.known else arrival.at - begun
        recorder.record(at, arrival.key, message)
        holes.see(at, arrival.key, message.header)


def _folder(fleet: FleetAddress, out: Path | None) -> Path:
    """Create and return the folder; it contains the scenario (walls, obstacles) if the world runs on this machine."""
    scenario = scenario_of_fleet(fleet)
    path = out or RUNS / f"{fleet.name}-{time.strftime('%Y%m%d-%H%M%S')}"
    if scenario is not None:
        return make(path, scenario)
    try:
        path.mkdir(parents=True)
    except OSError as error:
        raise Refused(f"--out {path}: cannot be made ({error.strerror}), give a new place to write to") from None
    return path
