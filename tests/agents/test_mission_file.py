"""A mission file is the [mission] of a scenario in a file of its own; all of its mistakes are said at once."""

from __future__ import annotations

from pathlib import Path

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
