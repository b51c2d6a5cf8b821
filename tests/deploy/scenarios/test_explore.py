"""Unknown ground from start to end in the simulator: the goal is reached, or the reason is said; the map loads back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lfa.deploy.analysis.verification.explored_map import map_of
from lfa.deploy.run.simulate import run
from lfa.protocol.errors import Refused
from lfa.world.description import maps
from lfa.world.description.load import load

DEPOT = next(
    (path for up in Path(__file__).resolve().parents if (path := up / "shared/data/maps/depot.yaml").is_file()), None
)
TEAM = ("mission.robots=[1,2]", "mission.formation.separation_m=0.6", "time_limit_s=90")

BOXES = """world.obstacles=[
{center_m=[4.5, 2.55], corners_m=[[-1.5, -0.05], [1.48, -0.05], [1.48, 0.05], [-1.5, 0.05]]},
{center_m=[3.05, 3.7], corners_m=[[-0.05, -1.2], [0.05, -1.2], [0.05, 1.2], [-0.05, 1.2]]}]""".replace("\n", " ")
"""Round the goal, in no map: what walls bar is refused before it starts."""


def room(folder: Path, *walls: tuple[int, int, int, int]) -> maps.Map:
    """6 m x 5 m with walls all round and others (row, row, column, column) of 0.1 m cells."""
    cells = np.zeros((50, 60), dtype=np.int16)
    for low, high, left, right in ((0, 1, 0, 60), (49, 50, 0, 60), (0, 50, 0, 1), (0, 50, 59, 60), *walls):
        cells[low:high, left:right] = 100
    drawn = maps.Map(cells, 0.1)
    maps.write(folder / "room.yaml", drawn)
    return drawn


def overlay(seen: maps.Map, true: maps.Map) -> tuple[int, float]:
    """How many cells were seen occupied, and the share of them that lies within one cell of a true wall."""
    space, cell_m = maps.Room(true), seen.resolution_m
    rows, columns = np.nonzero(seen.occupied)
    centers = [
        seen.to_map((column + 0.5) * cell_m, (row + 0.5) * cell_m) for row, column in zip(rows, columns, strict=True)
    ]
    off_m = np.array([space.clearance_m(*center) for center in centers])
    return len(off_m), float((off_m <= cell_m).mean())


@pytest.fixture(scope="module")
def explored(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, maps.Map, str, int]:
    """A run round a wall that is longer than it looks; its folder, the true map, the outcome, the contacts."""
    folder = tmp_path_factory.mktemp("explored")
    true = room(folder, (0, 34, 29, 31))
    sets = [f"map={folder / 'room.yaml'}", "start=1.5,1.5", "goal=4.8,1.5", *TEAM]
    ended = run(load("explore", sets), 1, folder / "run")
    return ended.folder, true, ended.summary.outcome, sum(robot.contacts for robot in ended.summary.robots)


def test_the_goal_behind_an_unknown_wall_is_reached_without_contact(
    explored: tuple[Path, maps.Map, str, int],
) -> None:
    folder, _, outcome, contacts = explored
    assert (outcome, contacts) == ("goal_reached", 0), f"look at {folder}"


def test_the_leaders_map_overlays_the_true_one(explored: tuple[Path, maps.Map, str, int], tmp_path: Path) -> None:
    folder, true, _, _ = explored
    maps.write(tmp_path / "map.yaml", map_of(folder))
    seen, on_walls = overlay(maps.read(tmp_path / "map.yaml"), true)
    assert seen > 100
    assert on_walls >= 0.95


def test_a_map_of_a_damaged_journal_is_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "journal").mkdir()
    (tmp_path / "journal" / "robot1-1.bin").write_bytes(b"no journal")
    with pytest.raises(Refused, match=r"robot1-1.bin: cannot be read \(.*not a journal\)"):
        map_of(tmp_path)


@pytest.mark.skipif(DEPOT is None, reason="no shared/data/maps beside the checkout or above it")
def test_depot_given_by_set_is_explored_and_the_leaders_map_overlays_it(tmp_path: Path) -> None:
    sets = [f"map={DEPOT}", "start=6,4", "goal=10,8", *TEAM]
    ended = run(load("explore", sets), 0, tmp_path / "run")
    contacts = sum(robot.contacts for robot in ended.summary.robots)
    assert (ended.summary.outcome, contacts) == ("goal_reached", 0), f"look at {tmp_path}"
    maps.write(tmp_path / "map.yaml", map_of(ended.folder))
    assert DEPOT is not None
    seen, on_walls = overlay(maps.read(tmp_path / "map.yaml"), maps.read(DEPOT))
    assert seen > 100
    assert on_walls >= 0.95


def test_a_goal_that_turns_out_to_be_walled_in_ends_the_mission_with_that_reason(tmp_path: Path) -> None:
    room(tmp_path)
    sets = [f"map={tmp_path / 'room.yaml'}", "start=1.5,1.5", "goal=4.5,4.0", *TEAM, BOXES]
    summary = run(load("explore", sets), 1, tmp_path / "run").summary
    assert summary.outcome == "failed", f"look at {tmp_path}"
    assert summary.reason is not None and "walled in" in summary.reason
