"""A mission file is the [mission] of a scenario in a file of its own; all of its mistakes are said at once."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from lfa.agents.cli import read_mission
from lfa.protocol.errors import Refused

RIGHT = "robots = [1, 2]\n[leading]\nroute_m = [[9, 0]]\n"


def test_a_mission_file_is_the_mission_of_a_scenario(tmp_path: Path) -> None:
    path = tmp_path / "mission.toml"
    path.write_text(RIGHT)
    assert read_mission(path).robots == (1, 2)


def test_every_mistake_of_a_mission_file_has_its_line(tmp_path: Path) -> None:
    path = tmp_path / "mission.toml"
    path.write_text(f"profil = 'std'\n{RIGHT}cruise_mps = 9\n[formation]\nside = 'up'\n")
    with pytest.raises(Refused) as refused:
        read_mission(path)
    assert [line.removeprefix(f"{path}:").partition(" = ")[0] for line in refused.value.lines] == [
        "1: mission.profil",
        "5: mission.leading.cruise_mps",
        "7: mission.formation.side",
    ]


def test_every_mistake_of_a_mission_in_json_is_said_at_once(tmp_path: Path) -> None:
    path = tmp_path / "mission.json"
    path.write_text(
        '{"profil": "std", "robots": [1, 2], "leading": {"route_m": [[9, "x"]], "cruise_mps": 9}, "radius_m": true}'
    )
    with pytest.raises(Refused) as refused:
        read_mission(path)
    assert [line.removeprefix(f"{path}: ").partition(" = ")[0] for line in refused.value.lines] == [
        "mission.profil",
        "mission.leading.route_m[0][1]",
        "mission.radius_m",
        "mission.leading.cruise_mps",
    ]


def test_a_mission_in_json_is_the_one_in_toml_and_may_hold_nulls(tmp_path: Path) -> None:
    toml, same = tmp_path / "mission.toml", tmp_path / "mission.json"
    toml.write_text(RIGHT)
    same.write_bytes(msgspec.json.encode(read_mission(toml)))
    assert b"null" in same.read_bytes()
    assert read_mission(same) == read_mission(toml)


@pytest.mark.parametrize("nested", ['{"a":' * 900 + "1" + "}" * 900, '{"a":' + "[" * 900 + "]" * 900 + "}"])
def test_a_mission_nested_without_end_is_refused(tmp_path: Path, nested: str) -> None:
    path = tmp_path / "mission.json"
    path.write_text(nested)
    with pytest.raises(Refused):
        read_mission(path)
