"""Loading of scenarios from TOML files: shipped ones by name, others by path, fields overridden by `--set a.b=value`.

Unknown keys, wrong types and impossible values raise RefusedFile, all at once, each with a line: the source (file and
line, `--set` or `--robots`), the key, the value and what would be valid.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from lfa.protocol.config_file.conversion import convert
from lfa.protocol.config_file.mistake import (
    FileError,
    Mistake,
    RefusedFile,
    RefusedValue,
    Rule,
    apply_rules,
    overlap,
    spoiled,
    wrong,
)
from lfa.protocol.config_file.toml_file import TomlFile, read_toml
from lfa.protocol.errors import Refused
from lfa.protocol.mission_checks import MISSION_RULES
from lfa.protocol.names import whole_number
from lfa.protocol.plug_in import is_file
from lfa.protocol.transport.link_model import Radio
from lfa.world.description.checks import ROBOTS_MAX, SCENARIO_RULES
from lfa.world.description.course_rules import COURSE_RULE, PLACES
from lfa.world.description.generator import GENERATORS, document_of, generated, refuse
from lfa.world.description.own_sensor import SENSOR_RULE
from lfa.world.description.placement import starts_of, varied
from lfa.world.description.scenario import Body, Lidar, Noise, Obstacle, Outcome, Point, Scenario, Vary, WorldSpec

__all__ = [
    "Body",
    "Lidar",
    "Noise",
    "Obstacle",
    "Outcome",
    "Point",
    "Radio",
    "Scenario",
    "Vary",
    "WorldSpec",
    "draw",
    "load",
    "shipped",
    "starts_of",
]

SCENARIOS = Path(__file__).parents[1] / "scenarios"
SHORT_FORMS = {
    "map": "world.map",
    "keepout": "world.keepout",
    "start": "world.start",
    "goal": "mission.leading.route_m",
}
"""Short names for keys in `--set`; `goal=[x, y]` is a route of one point."""
INSTEAD_OF = {"world.start": "starts", "world.starts": "start"}
"""Keys that exclude each other: setting one removes the other."""
QUOTES = "'\""


def titled() -> dict[str, Scenario]:
    """Return the scenarios of this package by name, unchecked and without their maps, whose readers are an extra."""
    return {name: convert(read_toml(SCENARIOS / f"{name}.toml", "").document, Scenario)[0] for name in _names()}


def shipped() -> dict[str, Scenario]:
    """Return the scenarios of this package by name."""
    return {name: load(name) for name in _names()}


def load(
    name_or_path: str, overrides: Sequence[str] = (), robots: int | None = None, rules: Sequence[Rule[Scenario]] = ()
) -> Scenario:
    """Load the shipped scenario of that name, or the one in that file, apply overrides and check it.

    `overrides` are texts `a.b=value` with a TOML value (bare words are text); `robots` renumbers the team to 1..N;
    `rules` are those of rooms that this one does not know. Raises RefusedFile with all mistakes: file, line, key,
    value, what would be valid.
    """
    file = _file_of(name_or_path)
    path = file.path
    keys = [_override(file.document, override) for override in overrides]
    if robots is not None:
        _renumber(file.document, robots)
    scenario, mistakes = convert(file.document, Scenario)
    scenario = replace(scenario, name=scenario.saved_from or path.stem)
    if scenario.generator is not None:
        mistakes += _beside_generator(scenario)
        try:
            if not mistakes:
                _checked(scenario, scenario.seed, rules)
                return scenario
        except RefusedValue as refused:
            mistakes.append(refused.mistake)
        raise RefusedFile(_error(file, mistake, keys, robots) for mistake in mistakes)
    apply_rules(MISSION_RULES, scenario.mission, mistakes)
    apply_rules((*SCENARIO_RULES, SENSOR_RULE), scenario, mistakes)
    scenario = _on_map(_embodied(scenario), path.parent, mistakes)
    apply_rules((COURSE_RULE, *rules), scenario, mistakes)
    if mistakes:
        raise RefusedFile(_error(file, mistake, keys, robots) for mistake in mistakes)
    return scenario


def sensors_in(name_or_path: str) -> set[str]:
    """Return the names of the sensors of a user's own in that scenario's file, unchecked. Raises Refused."""
    world = _file_of(name_or_path).document.get("world", {})
    sensors = world.get("sensors", {}) if isinstance(world, dict) else {}
    return set(sensors) if isinstance(sensors, dict) else set()


def draw(scenario: Scenario, seed: int) -> Scenario:
    """Return `scenario` as its generator, if it has one, makes it for `seed`, and varied by the seed within its bounds.

    Raises Refused for a generator that fails, and RefusedFile for what it makes wrong.
    """
    return varied(scenario if scenario.generator is None else _checked(scenario, seed), seed)


def _checked(scenario: Scenario, seed: int, rules: Sequence[Rule[Scenario]] = ()) -> Scenario:
    """Return what the generator of `scenario` makes for `seed`. Raises RefusedFile with all mistakes in that."""
    assert scenario.generator is not None
    drawn, mistakes = generated(scenario, seed)
    apply_rules(MISSION_RULES, drawn.mission, mistakes)
    apply_rules((*SCENARIO_RULES, SENSOR_RULE), drawn, mistakes)
    drawn = _embodied(drawn)
    apply_rules((*rules, COURSE_RULE), drawn, mistakes)
    if mistakes:
        raise refuse(scenario.generator.name, seed, mistakes)
    return drawn


def _embodied(scenario: Scenario) -> Scenario:
    """Return `scenario` with one polygon for the simulated bodies and for what the robots know of them."""
    mission, world = scenario.mission, scenario.world
    if not (mission.footprint_m or world.body.footprint_m):
        return scenario
    corners = mission.footprint_m or world.body.footprint_m
    body = replace(world.body, footprint_m=corners)
    return replace(scenario, mission=replace(mission, footprint_m=corners), world=replace(world, body=body))


def _beside_generator(scenario: Scenario) -> list[Mistake]:
    """Return a mistake for each key that a scenario with a generator cannot have."""
    world = scenario.world
    given = {"world.map": world.map, "world.keepout": world.keepout, "world.start": world.start}
    return [wrong(key, value, "left out with a generator") for key, value in given.items() if value is not None]


def _on_map(scenario: Scenario, folder: Path, mistakes: list[Mistake]) -> Scenario:
    """Resolve the map of a scenario; without a map the image readers are not imported."""
    world = scenario.world
    if overlap(PLACES, spoiled(mistakes)) or (world.map is None and world.keepout is None and world.start is None):
        return scenario
    from lfa.world.description.map_scenario import on_map

    try:
        return on_map(scenario, folder)
    except RefusedValue as refused:
        mistakes.append(refused.mistake)
        return scenario


def _error(file: TomlFile, mistake: Mistake, overridden: list[str], robots: int | None) -> FileError:
    """Return a mistake with its place: the command line if it set one of the keys involved, else the line."""
    name = file.path.name if file.path.parent == SCENARIOS else str(file.path)
    if robots is not None and mistake.key in ("mission.robots", "world.starts"):
        return FileError(f"--robots {robots}", str(mistake), key=mistake.key)
    if overlap((mistake.key, *mistake.compared), overridden):
        return FileError(f"{file.path.name} with --set", str(mistake), key=mistake.key)
    if not file.lines:  # what a generator's name stands for
        return FileError(name, str(mistake), key=mistake.key)
    return file.error(mistake, name)


def _names() -> list[str]:
    return sorted(path.stem for path in SCENARIOS.glob("*.toml"))


def _file_of(name_or_path: str) -> TomlFile:
    """Return the scenario file of that path or shipped name, or the one that a generator's name stands for."""
    if name_or_path in _names():
        return read_toml(SCENARIOS / f"{name_or_path}.toml", "a scenario file")
    path = Path(name_or_path)
    if is_file(name_or_path) and path.name in GENERATORS.names():  # loaded by the command line
        return TomlFile(Path(path.name), document_of(path.name), {})
    if path.suffix == ".toml" or len(path.parts) > 1:
        return read_toml(path, "a scenario file")
    generators = GENERATORS.names()
    if name_or_path in generators:
        return TomlFile(path, document_of(name_or_path), {})
    close = get_close_matches(name_or_path, [*_names(), *generators], n=1)
    shown = f"shipped are {', '.join(_names())}; {'generators are ' if generators else ''}{', '.join(generators)}"
    hint = f"did you mean {close[0]!r}?" if close else f"{shown.rstrip('; ')}; a file ends in .toml"
    raise Refused(f"no scenario {name_or_path!r}: {hint}")


def _override(document: dict[str, Any], override: str) -> str:
    """Apply `a.b=value` or `a.b[0].c=value` to `document` and return the key it sets. Raises Refused."""
    key, equals, text = override.partition("=")
    key, text = key.strip(), text.strip()
    if key in ("start", "goal") and not text.startswith("["):
        text = f"[{text}]"
    if key == "goal":
        text = f"[{text}]"
    key = SHORT_FORMS.get(key, key)
    if key in ("world.map", "world.keepout"):  # relative to the working directory, not to the scenario's file
        text = f"'{Path(text.strip(QUOTES)).absolute()}'"
    if not equals or not re.fullmatch(r"\w+(\.\w+|\[\d+\])*", key):
        raise Refused(f"--set {override!r}: must be key=value, such as world.lidar.beams=360")
    *way, last = (part if whole_number(part) is None else int(part) for part in re.findall(r"\w+", key))
    value = _toml_value(key, text)
    table: Any = document
    for part in way:
        table = _inside(table, part)
    if not _holds(table, last):
        raise Refused(f"--set {key} = {text}: must name a field of a scenario, and {key} is in none")
    table[last] = value
    if key in INSTEAD_OF:
        table.pop(INSTEAD_OF[key], None)
    return key


def _toml_value(key: str, text: str) -> Any:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        if re.fullmatch(r"[\w./ -]+", text):
            return text
        raise Refused(f"--set {key} = {text}: must be a TOML value (a number, text, true, [1, 2])") from None


def _inside(table: Any, part: str | int) -> Any:
    """Return the member of `table` at `part`, creating a missing table; None if `table` cannot hold members."""
    if not _holds(table, part):
        return None
    return table.setdefault(part, {}) if isinstance(table, dict) else table[part]


def _holds(table: Any, part: str | int) -> bool:
    if isinstance(table, list):
        return isinstance(part, int) and part < len(table)
    return isinstance(table, dict) and isinstance(part, str)


def _renumber(document: dict[str, Any], robots: int) -> None:
    """Set the team to ids 1..N; a longer list of starts is cut, a shorter one is refused later. Raises Refused."""
    if not isinstance(robots, int) or isinstance(robots, bool):  # from a script: the command line gives whole numbers
        raise Refused(f"robots={robots!r}: must be a whole number, the size of the team")
    if robots > ROBOTS_MAX:  # before a list of that length is built
        raise Refused(f"--robots {robots}: mission.robots = {robots} ids: must be at most {ROBOTS_MAX} ids")
    mission, world = document.setdefault("mission", {}), document.get("world", {})
    if isinstance(mission, dict):
        mission["robots"] = list(range(1, robots + 1))
    starts = world.get("starts") if isinstance(world, dict) else None
    if isinstance(starts, list):
        world["starts"] = starts[:robots]
