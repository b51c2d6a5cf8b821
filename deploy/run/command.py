"""The command line that `lfa run` and `lfa sim` share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from lfa.deploy.analysis.assertions import check_junit
from lfa.deploy.faults.script import Fault, parse_all
from lfa.deploy.own_code import Behavior, Controller, Sensor, with_own_code
from lfa.deploy.run.finish import Ended, kept_as, report
from lfa.deploy.run.load import rebuild_scenario
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

Run = Callable[[Scenario, int, Path | None, Sequence[Fault]], Ended]
Fit = Callable[[Scenario, frozenset[str]], Scenario]
"""Change of a scenario for the machine that runs it, of other keys than those that are set on the command line."""


def scenario_command(run: Run, *, figures_by_default: bool, fit: Fit | None = None) -> Callable[..., int]:
    """Return the command that runs a scenario by `run`, changed by `fit`, and exits with the code of its summary."""

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
        figures: Figures = figures_by_default,
        record: Record = "full",
        junit: JUnit = None,
        verbose: Verbose = False,
        as_json: AsJson = False,
    ) -> int:
        chosen_by = with_own_code(scenario, overrides or (), controller, behavior, sensor)
        chosen, number = rebuild_scenario(scenario, chosen_by, robots, seed, map_from)
        faults = parse_all(chosen.mission, chosen.faults, fault or ())
        if junit is not None:
            check_junit(junit)
        if fit is not None:
            chosen = fit(chosen, frozenset(word.partition("=")[0].strip() for word in overrides or ()))
        if record == "none" and out is not None:
            raise Refused(f"--record none with --out {out}: nothing is kept, must be one of the two")
        with kept_as(record, out) as place:
            ended = run(chosen, number, place, faults)
            figures = figures and ended.signal is None and record == "full"
            return report(ended, figures=figures, as_json=as_json, junit=junit, verbose=verbose, record=record)

    return command
