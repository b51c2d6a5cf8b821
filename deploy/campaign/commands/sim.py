"""`lfa sim`: one simulated run; with `--seeds`, a campaign of them: the short form of a plan."""

from __future__ import annotations

from typing import Annotated

import typer

from lfa.deploy.campaign.commands.sweep import carry_out
from lfa.deploy.campaign.shard import WHOLE, parse_shard
from lfa.deploy.campaign.sweep.plan import plan_of
from lfa.deploy.campaign.sweep.short_form import plan_file
from lfa.deploy.own_code import Behavior, Controller, Sensor, with_own_code
from lfa.deploy.run import simulate
from lfa.deploy.run.command import request_of, run_requested
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


def command(
    scenario: ScenarioName,
    seed: Seed = None,
    seeds: Annotated[
        str | None, typer.Option(help="Many runs, of seeds 1..100: one for each, and for each of --set a=1,2,3.")
    ] = None,
    overrides: Overrides = None,
    controller: Controller = None,
    behavior: Behavior = None,
    sensor: Sensor = None,
    robots: Robots = None,
    fault: Faults = None,
    out: Out = None,
    map_from: MapFrom = None,
    figures: Figures = False,
    record: Record = "full",
    junit: JUnit = None,
    verbose: Verbose = False,
    jobs: Annotated[int, typer.Option(help="With --seeds: number of parallel processes.")] = 1,
    shard: Annotated[str | None, typer.Option(help="With --seeds: do only this share of the runs, 3/16.")] = None,
    as_json: AsJson = False,
) -> int:
    """Run a scenario in virtual time, once or many times."""
    if seeds is None:
        if jobs != 1 or shard is not None:
            raise Refused("--jobs and --shard: must go with --seeds, for many runs")
        return run_requested(request_of(locals()), simulate.run)
    if seed is not None or map_from is not None or junit is not None:
        raise Refused(f"--seeds {seeds}: must go without --seed, --map-from and --junit")
    share = WHOLE if shard is None else parse_shard(shard)
    chosen_by = with_own_code(scenario, overrides or (), controller, behavior, sensor)
    file = plan_file(scenario, seeds, chosen_by, robots, fault or ())
    return carry_out(plan_of(file), out, share, jobs, as_json)
