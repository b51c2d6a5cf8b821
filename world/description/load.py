"""Loading of scenarios from TOML files: shipped ones by name, others by path, fields overridden by `--set a.b=value`.

An unknown key, a wrong type or an impossible value raises Refused with one line: the source (the file, `--set` or
`--robots`), the key, the value and what would be valid.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import msgspec
from msgspec.structs import replace

from lfa.protocol.errors import Refused
from lfa.protocol.names import whole_number
from lfa.protocol.transport.link_model import Radio
from lfa.world.description.checks import ROBOTS_MAX, check_scenario
from lfa.world.description.fields import converted, structs_in, value_at
from lfa.world.description.placement import check_course, draw, starts_of
from lfa.world.description.scenario import Body, Lidar, Noise, Obstacle, Outcome, Point, Scenario, Vary, WorldSpec
from lfa.world.description.toml_file import read_toml

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
NUMBER_MAX = 1e9


def shipped() -> dict[str, Scenario]:
    """Return the scenarios of this package by name."""
    return {name: load(name) for name in _names()}


def load(name_or_path: str, overrides: Sequence[str] = (), robots: int | None = None) -> Scenario:
    """Load the shipped scenario of that name, or the one in that file, apply overrides and check it.

    `overrides` are texts `a.b=value` with a TOML value (bare words are text); `robots` renumbers the team to 1..N.
    Raises Refused with one line: file, key, value, what would be valid.
    """
    path = _path_of(name_or_path)
    document = read_toml(path, "a scenario file")
    keys = [_override(document, override) for override in overrides]
    if robots is not None:
        _renumber(document, robots)
        keys.append("mission.robots")
    try:
        _refuse_unknown(document)
        _refuse_endless(document)
        scenario = _on_map(replace(converted(document), name=path.stem), path.parent)
        return check_course(check_scenario(scenario))
    except Refused as refused:
        raise Refused(f"{_source(str(refused), keys, robots, path)}: {refused}") from None


def _on_map(scenario: Scenario, folder: Path) -> Scenario:
    """Resolve the map of a scenario; without a map the image readers are not imported."""
    if scenario.world.map is None and scenario.world.keepout is None and scenario.world.start is None:
        return scenario
    from lfa.world.description.map_scenario import on_map

    return on_map(scenario, folder)


def _names() -> list[str]:
    return sorted(path.stem for path in SCENARIOS.glob("*.toml"))


def _path_of(name_or_path: str) -> Path:
    if name_or_path in _names():
        return SCENARIOS / f"{name_or_path}.toml"
    path = Path(name_or_path)
    if path.suffix == ".toml" or len(path.parts) > 1:
        return path
    close = get_close_matches(name_or_path, _names(), n=1)
    hint = f"did you mean {close[0]!r}?" if close else f"shipped are {', '.join(_names())}; a file ends in .toml"
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
    except (tomllib.TOMLDecodeError, RecursionError):
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
    if robots > ROBOTS_MAX:  # before a list of that length is built
        raise Refused(f"--robots {robots}: mission.robots = {robots} ids: must be at most {ROBOTS_MAX} ids")
    mission, world = document.setdefault("mission", {}), document.get("world", {})
    if isinstance(mission, dict):
        mission["robots"] = list(range(1, robots + 1))
    starts = world.get("starts") if isinstance(world, dict) else None
    if isinstance(starts, list):
        world["starts"] = starts[:robots]


def _refuse_unknown(document: dict[str, Any]) -> None:
    for where, known, given in _tables(document, Scenario, ""):
        for key in given:
            if key not in known:
                close = get_close_matches(key, known, n=1)
                hint = f"did you mean {close[0]!r}?" if close else f"known are {', '.join(known)}"
                raise Refused(f"{where}{key} = {value_at(given, key)}: no such key: {hint}")


def _tables(value: Any, type_: Any, where: str) -> Iterator[tuple[str, tuple[str, ...], dict[str, Any]]]:
    """Yield every TOML table in `value` that stands for a Struct: its path, its allowed keys, the table itself."""
    if isinstance(value, list):
        for index, item in enumerate(value):
            yield from _tables(item, type_, f"{where.removesuffix('.')}[{index}].")
        return
    struct = next((t for t in structs_in(type_)), None)
    if struct is None or not isinstance(value, dict):
        return
    fields = {field.encode_name: field.type for field in msgspec.structs.fields(struct)}
    yield where, tuple(name for name in fields if where or name != "name"), value
    for key, item in value.items():
        if key in fields:
            yield from _tables(item, fields[key], f"{where}{key}.")


def _refuse_endless(value: Any, where: str = "") -> None:
    """Raise Refused for nan, inf and numbers above `NUMBER_MAX`: TOML allows them, no field of a scenario does."""
    if isinstance(value, int | float) and not abs(value) <= NUMBER_MAX:
        raise Refused(f"{where} = {value}: must be a finite number, at most {NUMBER_MAX:g}")
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        part = f"[{key}]" if isinstance(value, list) else f".{key}" if where else str(key)
        _refuse_endless(item, f"{where}{part}")


def _source(refusal: str, keys: list[str], robots: int | None, path: Path) -> str:
    """Return the source of the refused value: the command line if it set that key, else the file."""
    if robots is not None and refusal.startswith(("mission.robots", "world.starts")):
        return f"--robots {robots}"
    given = any(re.match(rf"{re.escape(key)}\b", refusal) for key in keys)
    return f"{path.name} with --set" if given else str(path if path.parent != SCENARIOS else path.name)
