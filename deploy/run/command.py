"""What `lfa run` and `lfa sim` share: a request, and its way from a scenario's name to a summary."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from msgspec import Struct

from lfa.deploy.analysis.assertions import check_junit
from lfa.deploy.faults.script import Fault, parse_all
from lfa.deploy.own_code import with_own_code
from lfa.deploy.run.finish import Ended, kept_as, report
from lfa.deploy.run.load import rebuild_scenario
from lfa.protocol.errors import Refused
from lfa.world.description.load import Scenario

Run = Callable[[Scenario, int, Path | None, Sequence[Fault]], Ended]
Fit = Callable[[Scenario, frozenset[str]], Scenario]
"""Change of a scenario for the machine that runs it, of other keys than those that are set on the command line."""


class ScenarioRequest(Struct, frozen=True, kw_only=True):
    """One run as the options of a command ask for it; `options.py` and `own_code.py` say what each means."""

    scenario: str
    seed: int | None
    overrides: list[str] | None
    controller: str | None
    behavior: list[str] | None
    sensor: list[str] | None
    robots: int | None
    fault: list[str] | None
    out: Path | None
    map_from: Path | None
    figures: bool
    record: Literal["full", "summary", "none"]
    junit: Path | None
    verbose: bool
    as_json: bool


def request_of(options: Mapping[str, Any]) -> ScenarioRequest:
    """Return the request among the options of a command, which have the names of its fields."""
    return ScenarioRequest(**{name: options[name] for name in ScenarioRequest.__struct_fields__})


def run_requested(request: ScenarioRequest, run: Run, fit: Fit | None = None) -> int:
    """Run the requested scenario by `run`, changed by `fit`; return the exit code of its summary. Raises Refused."""
    overrides, record = request.overrides or [], request.record
    chosen_by = with_own_code(request.scenario, overrides, request.controller, request.behavior, request.sensor)
    chosen, number = rebuild_scenario(request.scenario, chosen_by, request.robots, request.seed, request.map_from)
    faults = parse_all(chosen.mission, chosen.faults, request.fault or ())
    if request.junit is not None:
        check_junit(request.junit)
    if fit is not None:
        chosen = fit(chosen, frozenset(word.partition("=")[0].strip() for word in overrides))
    if record == "none" and request.out is not None:
        raise Refused(f"--record none with --out {request.out}: nothing is kept, must be one of the two")
    with kept_as(record, request.out) as place:
        ended = run(chosen, number, place, faults)
        return report(
            ended,
            figures=request.figures and ended.signal is None and record == "full",
            as_json=request.as_json,
            junit=request.junit,
            verbose=request.verbose,
            record=record,
        )
