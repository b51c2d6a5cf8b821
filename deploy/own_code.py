"""Plug-ins from files `FILE.py:Class` that are not installed: the options that load them, and those of a scenario."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated

import typer
from msgspec import Struct

from lfa.agents.behaviors.own_behavior import BEHAVIORS
from lfa.agents.following.controller import CONTROLLERS, find_controller
from lfa.agents.following.plugin import add_controller_file, is_model
from lfa.protocol.errors import Refused
from lfa.protocol.mission import Mission
from lfa.protocol.plug_in import PlugIns, is_file
from lfa.world.description.generator import GENERATORS
from lfa.world.description.load import Scenario, sensors_in
from lfa.world.description.own_sensor import SENSORS

PLUG_INS: dict[str, PlugIns] = {
    "controller": CONTROLLERS,
    "behavior": BEHAVIORS,
    "sensor": SENSORS,
    "generator": GENERATORS,
}
SENSOR_HZ = 10.0
"""Rate [Hz] of a sensor that a command line names, where neither scenario nor `--set` gives one."""

Controller = Annotated[
    str | None,
    typer.Option(help="Controller of the followers: an installed one, FILE.py:Class, or a learned one: FILE.onnx."),
]
Behavior = Annotated[
    list[str] | None, typer.Option(help="A behaviour of all robots: an installed one, or FILE.py:Class. Repeatable.")
]
Sensor = Annotated[
    list[str] | None,
    typer.Option(help=f"A sensor of all robots: an installed one, or FILE.py:Class, at {SENSOR_HZ:g} Hz. Repeatable."),
]

RunController = Annotated[
    str | None, typer.Option(help="FILE.py:Class or FILE.onnx of the runs' controller, if it is not installed.")
]
RunBehavior = Annotated[
    list[str] | None, typer.Option(help="FILE.py:Class of a behaviour of the runs that is not installed. Repeatable.")
]
RunSensor = Annotated[
    list[str] | None, typer.Option(help="FILE.py:Class of a sensor of the runs that is not installed. Repeatable.")
]


class OwnFile(Struct, frozen=True):
    """A plug-in that is not installed: its kind, a key of `PLUG_INS`, and its absolute `FILE.py:Class` or model."""

    kind: str
    place: str

    @property
    def path(self) -> Path:
        return Path(self.place.rpartition(":")[0] if is_file(self.place) else self.place)


def chosen_files(scenario: Scenario) -> tuple[OwnFile, ...]:
    """Return the files of all plug-ins of `scenario` that are not installed."""
    return _files(_names(scenario))


def files_of_robots(mission: Mission) -> tuple[OwnFile, ...]:
    """Return the files of those that the robots of `mission` need."""
    return _files(_names_of_robots(mission))


def load_files(files: Iterable[OwnFile]) -> None:
    """Load plug-ins into this process. Raises Refused for one that cannot be loaded."""
    for file in files:
        load_file(file.kind, file.place)


def load_file(kind: str, text: str) -> str:
    """Load a plug-in from its file, and return the name by which a scenario chooses it. Raises Refused."""
    return add_controller_file(text) if kind == "controller" else PLUG_INS[kind].add_file(text)


def given_files(
    controller: str | None, behaviors: Sequence[str] | None, sensors: Sequence[str] | None
) -> list[OwnFile]:
    """Return the plug-ins that the options of a command name."""
    given = {"controller": [controller] if controller else [], "behavior": behaviors or [], "sensor": sensors or []}
    return [OwnFile(kind, text) for kind, texts in given.items() for text in texts]


def options_of(files: Iterable[OwnFile], kinds: Sequence[str]) -> list[str]:
    """Return the words of a command line that load those of `files` that are of one of `kinds`."""
    return [word for file in files if file.kind in kinds for word in (f"--{file.kind}", file.place)]


def with_own_code(
    scenario: str,
    overrides: Sequence[str],
    controller: str | None = None,
    behaviors: Sequence[str] | None = None,
    sensors: Sequence[str] | None = None,
) -> list[str]:
    """Return `overrides` with the choice of the given plug-ins, loaded where they are `FILE.py:Class`.

    `scenario` may be the `FILE.py:Class` of a generator: it is loaded, too. Raises Refused.
    """
    if is_file(scenario):
        GENERATORS.add_file(scenario)
    known = {*sensors_in(scenario), *(key.split(".")[2] for key in overrides if key.startswith("world.sensors."))}
    named = [SENSORS.add_file(text) for text in sensors or ()]
    more = [f"world.sensors.{name}.rate_hz={SENSOR_HZ}" for name in named if name not in known]
    if controller is not None:
        more.append(f"mission.following.controller='{add_controller_file(controller)}'")
    if behaviors:
        more.append(f"mission.behaviors={[BEHAVIORS.add_file(text) for text in behaviors]}")
    return [*overrides, *more]


def refuse_missing(scenario: Scenario, folder: Path) -> None:
    """Raise Refused if a plug-in of `scenario`, the scenario of the run in `folder`, is neither installed nor loaded.

    Code in a run folder is not run unless it is asked for: the line says with which option.
    """
    for kind, name in _names(scenario):
        try:
            find_controller(name) if kind == "controller" else PLUG_INS[kind].find(name)
        except Refused:
            copy = folder / (name if is_file(name) or is_model(name) else f"FILE.py:{name}")
            raise Refused(f"{folder}: its {kind} {name} is not loaded: add --{kind} {copy}") from None


def _files(names: Iterable[tuple[str, str]]) -> tuple[OwnFile, ...]:
    places = ((kind, PLUG_INS[kind].file_of(name)) for kind, name in names)
    return tuple(OwnFile(kind, place) for kind, place in places if place is not None)


def _names_of_robots(mission: Mission) -> list[tuple[str, str]]:
    return [("controller", mission.following.controller), *(("behavior", name) for name in mission.behaviors)]


def _names(scenario: Scenario) -> list[tuple[str, str]]:
    """Return kind and name of each plug-in that `scenario` chooses."""
    names = [*_names_of_robots(scenario.mission), *(("sensor", name) for name in scenario.world.sensors)]
    return names if scenario.generator is None else [*names, ("generator", scenario.generator.name)]
