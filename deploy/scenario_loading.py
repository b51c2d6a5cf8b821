"""Loading of a scenario with overrides from the command line, and with the checks of robots and of faults."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lfa.agents.following.controller import find_controller
from lfa.agents.following.factory import gains_of
from lfa.deploy.faults.script import parse
from lfa.protocol.config_file.mistake import Mistake, Rule
from lfa.protocol.errors import Refused
from lfa.world.description.load import Scenario, load


def load_scenario(scenario: str, overrides: Sequence[str] = (), robots: int | None = None) -> Scenario:
    """Return `scenario` (name or path) with its values overridden.

    Also checks what otherwise only a robot or a launcher checks: gains, controller and faults. Raises RefusedFile.
    """
    return load(scenario, overrides, robots, RULES)


def _gains(scenario: Scenario) -> Iterator[Mistake]:
    try:
        gains_of(scenario.mission)
    except Refused as refused:
        yield Mistake("mission.following.gains", f": {refused}")


def _controller(scenario: Scenario) -> Iterator[Mistake]:
    try:
        find_controller(scenario.mission.following.controller)
    except Refused as refused:
        yield Mistake("mission.following.controller", f": {refused}")


def _faults(scenario: Scenario) -> Iterator[Mistake]:
    for n, text in enumerate(scenario.faults):
        try:
            parse(text, scenario.mission, "")
        except Refused as refused:
            yield Mistake(f"faults[{n}]", f" = {str(refused).strip()}")


RULES: tuple[Rule[Scenario], ...] = (
    Rule(_gains, ("mission.following", "mission.limits")),
    Rule(_controller),
    Rule(_faults, ("mission.robots",)),
)
