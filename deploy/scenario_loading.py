"""Loading of a scenario with overrides from the command line, and with the checks of robots and of faults."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from lfa.agents.behaviors.own_behavior import OwnBehaviors
from lfa.agents.config import Gains
from lfa.agents.following.factory import gains_of
from lfa.agents.following.plugin import make_controller
from lfa.deploy.faults.feasible import check_faults
from lfa.deploy.faults.script import parse
from lfa.deploy.own_code import OwnFile, load_files, refuse_missing
from lfa.deploy.recording.run_folder import SCENARIO, scenario_of
from lfa.protocol.config_file.mistake import Mistake, RefusedValue, Rule
from lfa.protocol.errors import Refused
from lfa.world.description.course_rules import PLACES
from lfa.world.description.load import Scenario, load
from lfa.world.description.own_sensor import INSTALLED_RULE


def load_scenario(scenario: str, overrides: Sequence[str] = (), robots: int | None = None) -> Scenario:
    """Return `scenario` (name or path) with its values overridden.

    Also checks what otherwise only a robot or a launcher checks: gains, controller and faults. Raises RefusedFile.
    """
    return load(scenario, overrides, robots, RULES)


def load_code_of_run(folder: Path, given: Sequence[OwnFile]) -> None:
    """Load what re-executes a run: the plug-ins `given`, else nothing where the run's own are installed.

    Raises Refused with the option that would load the copy of a plug-in that is missing.
    """
    load_files(given)
    if (folder / SCENARIO).is_file():
        refuse_missing(scenario_of(folder), folder)


def _gains(scenario: Scenario) -> Iterator[Mistake]:
    try:
        gains_of(scenario.mission)
    except Refused as refused:
        yield Mistake("mission.following.gains", f": {refused}")


def _controller(scenario: Scenario) -> Iterator[Mistake]:
    following = scenario.mission.following
    try:
        make_controller(following, Gains(), scenario.mission.limits)
    except Refused as refused:
        name = re.match(r"[\w.]+", str(refused))
        end = 0 if name is None else name.end()
        yield Mistake(f"mission.following.{str(refused)[:end]}", str(refused)[end:])


def _behaviors(scenario: Scenario) -> Iterator[Mistake]:
    try:
        OwnBehaviors(scenario.mission)
    except RefusedValue as refused:
        yield refused.mistake


def _faults(scenario: Scenario) -> Iterator[Mistake]:
    for n, text in enumerate(scenario.faults):
        try:
            parse(text, scenario.mission, "")
        except Refused as refused:
            yield Mistake(f"faults[{n}]", f" = {str(refused).strip()}")


def _feasible(scenario: Scenario) -> Iterator[Mistake]:
    for n, text in enumerate(scenario.faults):
        try:
            check_faults(scenario, [parse(text, scenario.mission, "")])
        except Refused as refused:
            yield Mistake(f"faults[{n}]", f" = {text!r}: {refused}")


RULES: tuple[Rule[Scenario], ...] = (
    Rule(_gains, ("mission.following", "mission.limits", "mission.control_hz")),
    Rule(_controller),
    INSTALLED_RULE,
    Rule(_behaviors),
    Rule(_faults, ("mission.robots",)),
    Rule(_feasible, ("faults", "world.lidar.beams", *PLACES)),
)
