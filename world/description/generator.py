"""Scenario generators: plug-ins that draw a course from a seed and from parameters of their own.

A generator gets the scenario with all that its file and the command line say, and returns the one to run.
"""

from __future__ import annotations

from inspect import getdoc
from random import Random
from typing import Any, Protocol

import msgspec

from lfa.protocol.config_file.conversion import convert
from lfa.protocol.config_file.mistake import FileError, Mistake, RefusedFile, RefusedValue
from lfa.protocol.plug_in import FAULTS, PlugIns, error_text, place_of
from lfa.world.description.scenario import Scenario

GENERATORS = PlugIns("scenario generator", "lfa.scenarios", "")
TIME_LIMIT_S = 120.0
"""Time limit [s] of a generated scenario whose generator gives none."""


class ScenarioGenerator(Protocol):
    """Generator of scenarios. A class with a `Parameters` of its own is made with these, another one with nothing."""

    def generate(self, scenario: Scenario, chance: Random) -> Scenario:
        """Return `scenario` with a course; all chance comes from `chance`, so that a seed gives the same one again."""


def add_generator(name: str, make: Any) -> None:
    """Make the class `make` the scenario generator called `name` in this process: for a script or a notebook."""
    GENERATORS.add(name, make)


def document_of(name: str) -> dict[str, Any]:
    """Return the scenario file that the bare name of a generator stands for. Raises Refused."""
    return {"title": title_of(name), "time_limit_s": TIME_LIMIT_S, "mission": {}, "generator": {"name": name}}


def title_of(name: str) -> str:
    """Return the first line of the docstring of the generator `name`, else its name. Raises Refused."""
    lines = (getdoc(GENERATORS.find(name)) or "").splitlines()
    return lines[0] if lines else name


def generated(scenario: Scenario, seed: int) -> tuple[Scenario, list[Mistake]]:
    """Return the scenario that the generator of `scenario` makes for `seed`, and the mistakes of its types.

    Raises RefusedValue for an unknown generator, for parameters that it does not take, and for one that fails.
    """
    chosen = scenario.generator
    assert chosen is not None
    name = chosen.name
    made: ScenarioGenerator = GENERATORS.make(name, chosen.parameters, "generator")
    try:
        drawn = made.generate(scenario, Random(f"{seed}/generator {name}"))
    except FAULTS as error:
        says = f": {name} with seed {seed}: {error_text(error, made.generate)}"
        raise RefusedValue(Mistake("generator", says)) from None
    if not isinstance(drawn, Scenario):
        found = "nothing" if drawn is None else f"a value of type {type(drawn).__name__}"
        raise RefusedValue(
            Mistake("generator", f": {name}: {place_of(made.generate)}generate returned {found}, must be a Scenario")
        )
    try:
        fields = _plain(msgspec.to_builtins(drawn))
    except TypeError as error:
        raise RefusedValue(
            Mistake("generator", f": {name}: {place_of(made.generate)}generate returned no plain values: {error}")
        ) from None
    fields.pop("generator", None)
    fields.pop("name", None)
    typed, mistakes = convert(fields, Scenario)
    return msgspec.structs.replace(typed, name=scenario.name), mistakes


def refuse(name: str, seed: int, mistakes: list[Mistake]) -> RefusedFile:
    """Return the refusal of what the generator `name` made for `seed`."""
    return RefusedFile(FileError(f"scenario generator {name}, seed {seed}", str(one), key=one.key) for one in mistakes)


def _plain(value: Any) -> Any:
    """Return `value` as a TOML file has it: lists for tuples, and no key for None."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items() if item is not None}
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value
