"""What `lfa record` says of the fleet that it followed."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec import structs

from lfa.deploy.client.session import FleetAddress
from lfa.deploy.fleet.record import _Followed, _name
from lfa.deploy.recording.run_folder import SCENARIO
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import MissionNote
from lfa.world.description.load import load, shipped

SQUARE = ((0.2, 0.1), (-0.2, 0.1), (-0.2, -0.1), (0.2, -0.1))


@pytest.mark.parametrize(("file", "named"), [("straight", "straight"), ("scenario", "convoy")])
def test_a_recorded_run_is_named_by_its_scenario_or_where_a_run_folder_has_that_by_its_fleet(
    file: str, named: str
) -> None:
    assert _name(structs.replace(shipped()["straight"], name=file), "convoy") == named


def test_the_scenario_of_a_recorded_fleet_has_the_footprint_of_its_robots(tmp_path: Path) -> None:
    followed = _Followed(FleetAddress("convoy", "tcp/127.0.0.1:1", ()), tmp_path / "run", 1, 0)
    mission = structs.replace(shipped()["straight"].mission, footprint_m=SQUARE, radius_m=0.3)
    followed._see(MissionNote.of(Header("world", 1, 1, 0.0), mission), 0.0)
    followed.summarize(followed._recorder.close())
    assert load(str(followed.folder / SCENARIO)).mission.footprint_m == SQUARE
