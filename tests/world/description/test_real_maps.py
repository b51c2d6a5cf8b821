"""Maps of the Nav2 project, where they lie beside the checkout: read, made into walls, and given by --set."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lfa.protocol.errors import Refused
from lfa.world.description import maps
from lfa.world.description.load import load, starts_of

HERE = Path(__file__).resolve()
FOUND = next((p / "shared/data/maps" for p in HERE.parents if (p / "shared/data/maps").is_dir()), None)
pytestmark = pytest.mark.skipif(FOUND is None, reason="no shared/data/maps beside the checkout or above it")
MAPS = FOUND or Path()

#  map           columns, rows, [m] a cell  cells occupied, unknown  a start and a goal
TABLE = (
    ("depot", (604, 307), 0.05, 5947, 0, "6,4", "24,10"),
    ("depot_keepout", (604, 307), 0.05, 31213, 0, "6,4", "24,10"),
    ("empty_room", (200, 200), 0.1, 396, 0, "0,0", "3,3"),
    ("tb3_sandbox", (384, 384), 0.05, 870, 138683, "-2,-0.5", "1.8,0.5"),
)


@pytest.mark.parametrize(("name", "size", "resolution_m", "occupied", "unknown", "_s", "_g"), TABLE)
def test_a_map_is_read_with_its_size_and_its_cells(
    name: str, size: tuple[int, int], resolution_m: float, occupied: int, unknown: int, _s: str, _g: str
) -> None:
    drawn = maps.read(MAPS / f"{name}.yaml")
    assert (drawn.cells.shape[::-1], drawn.resolution_m) == (size, resolution_m)
    assert (int(drawn.occupied.sum()), int((drawn.cells == maps.UNKNOWN).sum())) == (occupied, unknown)


@pytest.mark.parametrize(("name", "_z", "_r", "_o", "_u", "start", "goal"), [row for row in TABLE if "k" not in row[0]])
def test_a_map_given_with_set_becomes_walls_and_room_for_the_chain(
    name: str, _z: object, _r: float, _o: int, _u: int, start: str, goal: str
) -> None:
    sets = [f"map={MAPS}/{name}.yaml", f"start={start}", f"goal={goal}", "mission.formation.separation_m=0.6"]
    scenario = load("explore", sets, robots=2)
    room = maps.Room(maps.read(MAPS / f"{name}.yaml"))
    assert all(room.clearance_m(pose.x, pose.y) >= 0.25 for pose in starts_of(scenario)[1:])
    ends = np.array(scenario.world.walls_m)[:, :2]
    assert max(room.clearance_m(x, y) for x, y in ends[:: max(1, len(ends) // 50)]) < 1e-6, "walls lie on cells' edges"


def test_what_is_written_overlays_what_was_read(tmp_path: Path) -> None:
    drawn = maps.read(MAPS / "tb3_sandbox.yaml")
    maps.write(tmp_path / "again.yaml", drawn)
    again = maps.read(tmp_path / "again.yaml")
    assert np.array_equal(again.cells, drawn.cells)
    assert (again.resolution_m, again.origin) == (drawn.resolution_m, drawn.origin)


def test_depots_keepout_mask_becomes_boxes_and_a_goal_in_one_is_refused() -> None:
    sets = [f"map={MAPS}/depot.yaml", f"keepout={MAPS}/depot_keepout.yaml", "start=6,4", "goal=24,10"]
    boxes = load("explore", sets).mission.leading.keepout_m
    area_m2 = sum((x2 - x1) * (y2 - y1) for x1, y1, x2, y2 in boxes)
    assert area_m2 == pytest.approx(31213 * 0.05**2)
    x1, y1, x2, y2 = max(boxes, key=lambda box: (box[2] - box[0]) * (box[3] - box[1]))
    with pytest.raises(Refused, match=r"keep-out|inside a wall|from the walls"):
        load("explore", [*sets[:3], f"goal={0.5 * (x1 + x2)},{0.5 * (y1 + y2)}"])


def test_a_goal_outside_of_the_room_that_the_robots_start_in_is_refused() -> None:
    with pytest.raises(Refused, match="must be a goal that can be reached, walls part it"):
        load("explore", [f"map={MAPS}/empty_room.yaml", "start=0,0", "goal=8,8"])
