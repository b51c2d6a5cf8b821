"""`lfa run`: a scenario as processes, in real time or, with `--lockstep`, in virtual time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from lfa.deploy.faults.script import Fault
from lfa.deploy.lockstep.run import run as lockstep_run
from lfa.deploy.lockstep.stepping import Pace, pace_of
from lfa.deploy.own_code import Behavior, Controller, Sensor
from lfa.deploy.run import launch
from lfa.deploy.run.command import Run, request_of, run_requested
from lfa.deploy.run.finish import Ended
from lfa.deploy.run.machine_size import fitted
from lfa.deploy.run.options import (
    AsJson,
    Faults,
    Figures,
    JUnit,
    MapFrom,
    Out,
    Overrides,
    Record,
    Robots,
    ScenarioName,
    Seed,
    Verbose,
)
from lfa.protocol.errors import Refused
from lfa.world.description.load import Scenario


def command(
    scenario: ScenarioName,
    seed: Seed = None,
    overrides: Overrides = None,
    controller: Controller = None,
    behavior: Behavior = None,
    sensor: Sensor = None,
    robots: Robots = None,
    fault: Faults = None,
    out: Out = None,
    map_from: MapFrom = None,
    figures: Figures = True,
    record: Record = "full",
    junit: JUnit = None,
    verbose: Verbose = False,
    as_json: AsJson = False,
    lockstep: Annotated[
        bool, typer.Option("--lockstep", help="Grant the processes virtual time: the run of `lfa sim`, repeatable.")
    ] = False,
    speed: Annotated[
        str | None, typer.Option(help="With --lockstep: times faster than real time, or max (default).")
    ] = None,
    pause: Annotated[bool, typer.Option("--pause", help="With --lockstep: stand at the start until lfa step.")] = False,
    step: Annotated[
        str | None, typer.Option(help="With --lockstep: stand after so many ticks (control periods) until lfa step.")
    ] = None,
) -> int:
    """Run a scenario as processes; return the exit code. Raises Refused."""
    if not lockstep and (pause or speed is not None or step is not None):
        raise Refused("--speed, --pause and --step: must go with --lockstep, in real time nothing waits for a process")
    request = request_of(locals())
    if lockstep:
        return run_requested(request, _in_lockstep(pace_of(speed, pause, step)))
    return run_requested(request, launch.run, fitted)


def _in_lockstep(pace: Pace) -> Run:
    def run(scenario: Scenario, seed: int, out: Path | None, faults: Sequence[Fault]) -> Ended:
        return lockstep_run(scenario, seed, out, faults, pace)

    return run
