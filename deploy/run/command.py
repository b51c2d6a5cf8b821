"""The command line that `lfa run` and `lfa sim` share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from lfa.deploy.analysis.assertions import check_junit
from lfa.deploy.faults.script import Fault, parse_all
from lfa.deploy.run.finish import Ended, report
from lfa.deploy.run.load import rebuild_scenario
from lfa.deploy.run.options import (
    AsJson,
    Controller,
    Faults,
    Figures,
    JUnit,
    MapFrom,
    Out,
    Overrides,
    Robots,
    ScenarioName,
    Seed,
)
from lfa.deploy.scenario_loading import with_controller
from lfa.world.description.load import Scenario


def scenario_command(run: Callable[[Scenario, int, Path | None, Sequence[Fault]], Ended]) -> Callable[..., int]:
    """Return the command that runs a scenario by `run` and exits with the code of its summary."""

    def command(
        scenario: ScenarioName,
        seed: Seed = None,
        overrides: Overrides = None,
        controller: Controller = None,
        robots: Robots = None,
        fault: Faults = None,
        out: Out = None,
        map_from: MapFrom = None,
        figures: Figures = True,
        junit: JUnit = None,
        as_json: AsJson = False,
    ) -> int:
        chosen, number = rebuild_scenario(
            scenario, with_controller(overrides or (), controller), robots, seed, map_from
        )
        faults = parse_all(chosen.mission, chosen.faults, fault or ())
        if junit is not None:
            check_junit(junit)
        ended = run(chosen, number, out, faults)
        return report(ended, figures=figures and ended.signal is None, as_json=as_json, junit=junit)

    return command
