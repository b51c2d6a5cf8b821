"""Robots without a scanner drive on open ground; what needs one is refused in one line."""

from __future__ import annotations

import pytest

from lfa.deploy.faults.feasible import check_faults
from lfa.deploy.faults.script import parse_all
from lfa.deploy.run.machine_size import slower
from lfa.protocol.errors import Refused
from lfa.world.description.load import load
from lfa.world.world import World

NO_LIDAR = "world.lidar.beams=0"


def test_the_world_of_robots_without_a_scanner_sends_no_scan() -> None:
    for beams, scans in (("world.lidar.beams=90", True), (NO_LIDAR, False)):
        world = World("f", load("straight", (beams,)), 1, 1, start_at=0.0)
        sent = [envelope.key.split("/")[3] for n in range(20) for envelope in world.tick(0.05 * n)]
        assert ("scan" in sent) == scans
        assert "sensors" in sent


@pytest.mark.parametrize(
    ("scenario", "settings", "key"),
    [
        ("crossing", (), "world.obstacles"),
        ("paper_path1", ("world.obstacles=[]",), "world.walls_m"),
        ("explore", (), "world.map"),
        ("explore", (), "mission.leading.motion = explore"),
        ("straight", ("mission.leading.motion=reactive",), "mission.leading.motion = reactive"),
    ],
)
def test_what_needs_a_scanner_is_refused_in_one_line_that_says_so(
    scenario: str, settings: tuple[str, ...], key: str
) -> None:
    with pytest.raises(Refused) as refused:
        load(scenario, (*settings, NO_LIDAR))
    lines = [line for line in str(refused.value).splitlines() if key in line]
    assert len(lines) == 1
    assert "for robots without a scanner (world.lidar.beams = 0)" in lines[0]


@pytest.mark.parametrize("fault", ["hang scanner 2 at 3 s", "obstacle 5,1.5,0.3 at 3 s"])
def test_a_fault_that_only_a_scanner_could_show_is_refused_without_one(fault: str) -> None:
    blind, seeing = load("straight", (NO_LIDAR,)), load("straight")
    check_faults(seeing, parse_all(seeing.mission, (), [fault]))
    with pytest.raises(Refused, match="without a scanner"):
        check_faults(blind, parse_all(blind.mission, (), [fault]))
    check_faults(blind, parse_all(blind.mission, (), ["hang driver 2 at 3 s"]))


def test_a_team_without_scanners_gets_none_where_a_machine_carries_too_few() -> None:
    assert slower(load("straight", (NO_LIDAR,), 30)).world.lidar.beams == 0
