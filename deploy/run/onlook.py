"""`lfa record`: a recording of a fleet that runs already, however it was started; ends with Ctrl-C or SIGTERM."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from deploy.look.onlooker import Ear, Fleet, find, listen, scenario_of_fleet
from deploy.run.folder import RUNS, About, make
from deploy.run.interrupts import Interrupts
from deploy.run.record import Recorder
from deploy.run.worldtime import WorldTime
from protocol import clock
from protocol.messages import Truth
from protocol.mission import Refused

POLL_S = 0.05


def command(
    fleet: Annotated[str | None, typer.Option(help="Needed when several fleets run here.")] = None,
    connect: Annotated[str | None, typer.Option(help="Another router than the fleet's own here.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder; default runs/<fleet>-<time>.")] = None,
    seconds: Annotated[float, typer.Option(help="End after so long; 0 goes on.")] = 0.0,
) -> int:
    found = find(fleet, connect)
    with listen(found, frozenset({"**"}), every=True) as ear, Interrupts() as interrupts:
        folder = _folder(found, out)
        recorder = Recorder(folder, About(found.name, "onlooker", 0, found.name).metadata())
        print(f"records fleet {found.name} into {folder}", flush=True)
        begun, count, seen = clock.now(), 0, WorldTime()
        while interrupts.signal is None and not 0.0 < seconds <= clock.now() - begun:
            clock.sleep(POLL_S)
            count += _write(ear, recorder, seen, begun)
        recorder.close()
    print(f"{count} messages, {ear.dropped} lost: {folder}")
    return 0 if count and not ear.dropped else 1


def _write(ear: Ear, recorder: Recorder, seen: WorldTime, begun: float) -> int:
    """Times are the world's, or since the start of the recording where no world tells its own."""
    heard = ear.take()
    for arrival, message in heard:
        if isinstance(message, Truth):
            seen.see(arrival.at, message.time_s)
        recorder.record(seen.of(arrival.at) if seen.known else arrival.at - begun, arrival.key, message)
    return len(heard)


def _folder(fleet: Fleet, out: Path | None) -> Path:
    """With the scenario in it where the world runs here, so that the views know walls and obstacles."""
    scenario = scenario_of_fleet(fleet)
    path = out or RUNS / f"{fleet.name}-{time.strftime('%Y%m%d-%H%M%S')}"
    if scenario is not None:
        return make(path, scenario)
    try:
        path.mkdir(parents=True)
    except OSError as error:
        raise Refused(f"--out {path}: cannot be made ({error.strerror}), give a new place to write to") from None
    return path
