"""`lfa schema`: every key of a scenario with unit, default and meaning, as the types have them."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import msgspec
import pytest

from lfa.deploy.config import schema
from lfa.world.description.load import SCENARIOS, load

PATHS = {key.path: key for key in schema.documented()}


def _given(value: object, where: str = "") -> set[str]:
    """The keys that a file gives."""
    if isinstance(value, dict):
        return {path for key, item in value.items() for path in _given(item, f"{where}.{key}" if where else key)}
    if isinstance(value, list) and any(isinstance(item, dict) for item in value):
        return {path for item in value for path in _given(item, f"{where}[]")}
    return {where}


@pytest.mark.parametrize("path", sorted(SCENARIOS.glob("*.toml")), ids=lambda path: path.stem)
def test_every_key_of_every_shipped_scenario_is_documented(path: Path) -> None:
    unknown = {key for key in _given(tomllib.loads(path.read_text())) if key not in PATHS}
    assert {key for key in unknown if not re.match(r"(mission\.following\.gains|restart)\.", key)} == set()


def test_a_key_has_its_unit_default_and_meaning() -> None:
    key = PATHS["mission.formation.separation_m"]
    assert (key.unit, key.default) == ("m", "1.2")
    assert "to the predecessor" in key.text
    assert PATHS["title"].default == ""
    assert "assert.failover_max_ms" in PATHS


def test_the_json_schema_is_whole_and_carries_the_meanings() -> None:
    made = msgspec.json.decode(msgspec.json.encode(schema.schema()))
    separation = made["$defs"]["FormationSpec"]["properties"]["separation_m"]
    assert separation["default"] == 1.2
    assert "predecessor" in separation["description"]
    assert "assert" in made["$defs"]["Scenario"]["properties"]


def test_the_table_has_a_row_for_every_key() -> None:
    rows = schema.table().splitlines()[2:]
    assert len(rows) == len(PATHS)
    assert all(row.count(" | ") >= 4 for row in rows)


def test_a_default_in_the_table_is_the_one_that_a_scenario_gets() -> None:
    assert PATHS["world.lidar.beams"].default == str(load("straight").world.lidar.beams)
