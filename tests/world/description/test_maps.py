"""ROS maps: read as Nav2 reads them, refused in one line, turned into walls in metres, and written to be read again."""

from __future__ import annotations

import struct
import zlib
from itertools import pairwise
from math import pi
from pathlib import Path

import numpy as np
import pytest

from lfa.protocol.errors import Refused
from lfa.world.description import maps
from lfa.world.description.load import load, starts_of
from lfa.world.description.reachability import parted

ROWS = ((0, 0, 0, 0), (0, 254, 205, 0), (0, 254, 254, 0))
"""Shades, the top row first: 4 columns, 3 rows."""


def yaml(folder: Path, content: bytes, name: str = "m.pgm", **fields: object) -> Path:
    given = {"image": name, "resolution": 0.5, "origin": "[1.0, 2.0, 0.0]", "negate": 0} | {
        "occupied_thresh": 0.65, "free_thresh": 0.196} | fields  # fmt: skip
    (folder / name).write_bytes(content)
    path = folder / "m.yaml"
    path.write_text("".join(f"{key}: {value}\n" for key, value in given.items() if value is not None))
    return path


def pgm(rows: tuple[tuple[int, ...], ...] = ROWS, header: bytes = b"P5\n# made by hand\n4 3\n255\n") -> bytes:
    return header + bytes(shade for row in rows for shade in row)


def png(rows: tuple[tuple[int, ...], ...] = ROWS, size: tuple[int, int] | None = None, depth: int = 8) -> bytes:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    lines = zlib.compress(b"".join(b"\0" + bytes(row) for row in rows))
    columns_rows = size or (len(rows[0]), len(rows))
    head = struct.pack(">IIBBBBB", *columns_rows, depth, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", lines) + chunk(b"IEND", b"")


AS_READ = [[100, 0, 0, 100], [100, 0, -1, 100], [100, 100, 100, 100]]
"""Occupancy, the bottom row first."""


def test_row_0_of_the_image_is_the_top_and_205_is_unknown(tmp_path: Path) -> None:
    assert maps.read(yaml(tmp_path, pgm())).cells.tolist() == AS_READ


def test_a_pgm_of_numbers_and_a_png_say_the_same_as_a_pgm_of_bytes(tmp_path: Path) -> None:
    numbers = " ".join(str(shade) for row in ROWS for shade in row)
    plain = f"P2 # of numbers\n4\n3\n# largest\n255\n{numbers}\n".encode()
    assert maps.read(yaml(tmp_path, plain)).cells.tolist() == AS_READ
    assert maps.read(yaml(tmp_path, png(), name="m.png")).cells.tolist() == AS_READ


@pytest.mark.parametrize(
    ("fields", "shade", "occupancy"),
    [
        ({}, 0, 100), ({}, 255, 0), ({}, 205, -1), ({"free_thresh": 0.25}, 205, 0),
        ({"negate": 1}, 255, 100), ({"negate": "true"}, 0, 0),
        ({"mode": "scale"}, 0, 100), ({"mode": "scale"}, 150, 48), ({"mode": "scale"}, 255, 0),
        ({"mode": "raw"}, 70, 70), ({"mode": "raw"}, 205, -1),
    ],
)  # fmt: skip
def test_thresholds_modes_and_negate_are_those_of_the_map_server(
    tmp_path: Path, fields: dict[str, object], shade: int, occupancy: int
) -> None:
    path = yaml(tmp_path, b"P5 1 1 255\n" + bytes([shade]), **fields)
    assert maps.read(path).cells.tolist() == [[occupancy]]


def test_walls_are_the_outlines_of_occupied_cells_in_metres_turned_by_the_origins_yaw(tmp_path: Path) -> None:
    image = b"P5 3 1 255\n" + bytes([254, 0, 0])
    turned = yaml(tmp_path, image, resolution=0.1, origin=f"[5.0, 1.0, {pi / 2}]")
    walls = {tuple(sorted(((x1, y1), (x2, y2)))) for x1, y1, x2, y2 in maps.walls(maps.read(turned))}
    corners = ((5.0, 1.1), (5.0, 1.3), (4.9, 1.1), (4.9, 1.3))
    a, b, c, d = corners
    assert walls == {tuple(sorted(edge)) for edge in ((a, b), (c, d), (a, c), (b, d))}


def test_a_straight_wall_is_one_segment_however_many_cells_it_has() -> None:
    cells = np.zeros((600, 300), dtype=np.int16)
    cells[10, :] = 100
    assert len(maps.walls(maps.Map(cells, 0.05))) == 4


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    cells = np.array(AS_READ, dtype=np.int16)
    maps.write(tmp_path / "again.yaml", maps.Map(cells, 0.1, (-1.5, 2.0, 0.25)))
    again = maps.read(tmp_path / "again.yaml")
    assert (again.cells.tolist(), again.resolution_m, again.origin) == (AS_READ, 0.1, (-1.5, 2.0, 0.25))


#        image                                          fields                       what the line must say
BAD = [
    (pgm(), {"image": None}, "image is missing"),
    (pgm(), {"image": "none.pgm"}, "none.pgm: cannot be read"),
    (pgm(), {"image": "m\0.pgm"}, "cannot be read (embedded null byte): must be a pgm or png"),
    (pgm(), {"image": "x" * 5000}, "xxx...: cannot be read (File name too long)"),
    (pgm(), {"image": "../no/m.pgm"}, "image = ../no/m.pgm: cannot be read"),
    (pgm(), {"mode": "trinary" + "\n" * 70_000}, "longer than 65536 bytes"),
    (pgm(), {"resolution": 0}, "resolution = 0"),
    (pgm(), {"resolution": "nan"}, "resolution = nan"),
    (pgm(), {"resolution": None}, "resolution is missing"),
    (pgm(), {"resolution": -0.05}, "resolution = -0.05"),
    (pgm(), {"origin": "[nan, 0, 0]"}, "origin = [nan, 0, 0]"),
    (pgm(header=b"P5 -4 3 255\n"), {}, "no pgm header"),
    (pgm(header=b"P5 4 3 0\n"), {}, "largest shade 0:"),
    (pgm(), {"origin": "[1, 2, x]"}, "origin = [1, 2, x]"),
    (pgm(), {"mode": "other"}, "mode = other"),
    (pgm(), {"negate": 2}, "negate = 2"),
    (pgm(), {"free_thresh": 0.9}, "free_thresh = 0.9"),
    (pgm()[:-1], {}, "11 cells: must be 4 x 3"),
    (pgm(header=b"P5 4 3 65535\n"), {}, "16-bit"),
    (pgm(header=b"P5 0 3 255\n"), {}, "0 x 3 cells"),
    (pgm(header=b"P5 999999999 999999999 255\n"), {}, "must be from 1 to"),
    (b"P5 4", {}, "no pgm header"),
    (b"P5" + b" " * 5000 + b"x", {}, "no pgm header"),
    (pgm() + b"more", {}, "16 cells: must be 4 x 3"),
    (b"P2 2 1 255 7 x", {}, "no number"),
    (b"GIF89a", {}, "neither pgm"),
    (png()[:40], {}, "no png"),
    (png()[:-13] + b"?" + png()[-12:], {}, "no png that can be read (broken PNG file"),
    (png(size=(60000, 60000)), {}, "far too many cells"),
    (png(depth=16), {}, "16-bit"),
]


@pytest.mark.parametrize(("image", "fields", "said"), BAD)
def test_a_bad_map_is_one_line_that_names_the_file(
    tmp_path: Path, image: bytes, fields: dict[str, object], said: str
) -> None:
    with pytest.raises(Refused) as refused:
        maps.read(yaml(tmp_path, image, **fields))
    assert said in str(refused.value) and str(tmp_path) in str(refused.value) and "\n" not in str(refused.value)


# --- in a scenario -------------------------------------------------------------------------------------------


def room(folder: Path) -> Path:
    """10 m x 6 m with walls all round and a block in the middle."""
    cells = np.zeros((60, 100), dtype=np.int16)
    cells[0], cells[-1], cells[:, 0], cells[:, -1] = 100, 100, 100, 100
    cells[25:35, 45:55] = 100
    maps.write(folder / "room.yaml", maps.Map(cells, 0.1))
    return folder / "room.yaml"


def test_set_knows_map_start_and_goal_by_their_short_names(tmp_path: Path) -> None:
    scenario = load("explore", [f"map={room(tmp_path)}", "start=4,1,0", "goal=[8.5, 4.5]"])
    assert scenario.mission.goal_m == (8.5, 4.5)
    assert len(scenario.world.walls_m) == 12
    assert scenario.world.map is None, "walls are held by the scenario itself, whoever reads it again"
    assert [pose.x for pose in starts_of(scenario)] == pytest.approx([4.0, 3.2, 2.4, 1.6])
    assert [pose.y for pose in starts_of(scenario)] == pytest.approx([1.0] * 4)


def test_a_map_given_with_set_is_relative_to_where_the_command_is_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    room(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert len(load("explore", ["map=room.yaml", "start=[4, 1]", "goal=8.5,4.5"]).world.walls_m) == 12


def test_a_chain_without_room_behind_it_is_laid_out_round_the_corner(tmp_path: Path) -> None:
    scenario = load("explore", [f"map={room(tmp_path)}", "start=0.8,3.0,0", "goal=8.5,4.5"])
    poses = starts_of(scenario)
    drawn = maps.Room(maps.read(tmp_path / "room.yaml"))
    assert min(drawn.clearance_m(pose.x, pose.y) for pose in poses) > 0.2


@pytest.mark.parametrize(
    ("sets", "said"),
    [
        (["goal=5.0,3.0"], "inside a wall"),
        (["goal=0.2,3.0"], "0.10 m from the walls"),
        (["goal=50,3"], "outside of the map"),
        (["start=5.0,3.0"], "inside a wall"),
        (["start=1"], "world.start"),
        (["world.starts=[[4,1,0],[5,3,0]]"], r"world.starts\[1\] = \[5.0, 3.0\]: inside a wall of the map"),
        (["world.starts=[[4,1,0],[-9,3,0]]"], r"world.starts\[1\] = \[-9.0, 3.0\]: outside of the map"),
        (["map=none.yaml"], "world.map = none.yaml"),
        (["start=-1,3"], r"world.start = \[-1.0, 3.0\]: outside of the map"),
        (["world.walls_m=[[7.0, 0.0, 7.0, 6.0]]"], r"\[8.5, 4.5\]: must be a goal that can be reached, walls part it"),
    ],
)
def test_a_start_or_goal_without_room_is_one_line(tmp_path: Path, sets: list[str], said: str) -> None:
    with pytest.raises(Refused, match=said) as refused:
        load("explore", [f"map={room(tmp_path)}", "start=4,1", "goal=8.5,4.5", *sets])
    assert "\n" not in str(refused.value)


def test_starts_given_with_set_take_the_place_of_the_scenarios_start_and_the_other_way_round(tmp_path: Path) -> None:
    poses = ((4.0, 1.0, 0.0), (3.0, 1.0, 0.0))
    sets = [f"map={room(tmp_path)}", "goal=8.5,4.5", "start=2,2", f"world.starts={[list(pose) for pose in poses]}"]
    assert load("explore", sets, robots=2).world.starts == poses
    assert starts_of(load("explore", [*sets, "start=2,2"], robots=2))[0].x == 2.0


def test_a_start_beside_starts_in_one_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "both.toml"
    both = "[world]\nstart = [1.0, 1.0]\nstarts = [[0.0, 0.0, 0.0]]\n"
    path.write_text(f"title = 'x'\ntime_limit_s = 9.0\n[mission]\nrobots = [1]\nleading.route_m = [[9.0, 0.0]]\n{both}")
    with pytest.raises(Refused, match=r"both.toml:7: world.start = \[1.0, 1.0\]: must be left out where world.starts"):
        load(str(path))


def test_a_keepout_mask_becomes_boxes_that_the_mission_tells(tmp_path: Path) -> None:
    cells = np.zeros((60, 100), dtype=np.int16)
    cells[10:20, 60:80] = 100
    maps.write(tmp_path / "keepout.yaml", maps.Map(cells, 0.1))
    sets = [f"map={room(tmp_path)}", f"keepout={tmp_path / 'keepout.yaml'}", "start=4,1", "goal=8.5,4.5"]
    assert load("explore", sets).mission.leading.keepout_m == ((6.0, 1.0, 8.0, 2.0),)


@pytest.mark.parametrize(
    ("box", "said"),
    [
        ("[3.0, 0.5, 4.5, 1.5]", r"keepout_m\[0\] = .*: must be clear of the start of robot 1 at \(4.00, 1.00\)"),
        ("[2.0, 5.0, 1.0, 4.0]", r"keepout_m\[0\] = \[2.0, 5.0, 1.0, 4.0\]: must be x1, y1, x2, y2"),
    ],
)
def test_a_keepout_box_that_forbids_the_start_or_nothing_is_refused(tmp_path: Path, box: str, said: str) -> None:
    with pytest.raises(Refused, match=said):
        load("explore", [f"map={room(tmp_path)}", "start=4,1", "goal=8.5,4.5", f"mission.leading.keepout_m=[{box}]"])


def test_a_goal_in_a_keepout_zone_is_refused(tmp_path: Path) -> None:
    cells = np.zeros((60, 100), dtype=np.int16)
    cells[40:50, 80:90] = 100
    maps.write(tmp_path / "keepout.yaml", maps.Map(cells, 0.1))
    sets = [f"map={room(tmp_path)}", f"keepout={tmp_path / 'keepout.yaml'}", "start=4,1", "goal=8.5,4.5"]
    with pytest.raises(Refused, match="outside of the keep-out box"):
        load("explore", sets)


def test_walls_with_a_gap_that_only_a_smaller_robot_fits_through_part_the_ground() -> None:
    for angle in (0.0, 0.3, pi / 4, 1.1):
        c, s = np.cos(angle), np.sin(angle)
        box = [(2.0, -2.0), (2.0, 2.0), (-2.0, 2.0), (-2.0, -2.0), (1.33, -2.0)]
        turned = [(c * x - s * y, s * x + c * y) for x, y in box]
        walls = [(*a, *b) for a, b in pairwise(turned)]
        parts = [parted([(0.0, 0.0), (9.0, 1.0)], walls, robot_m) for robot_m in (0.25, 0.333, 0.5)]
        assert parts == [None, None, (9.0, 1.0)], angle


@pytest.mark.parametrize(("gap_m", "barred"), [(0.0, True), (0.3, False)])
def test_walls_with_a_gap_that_a_robot_fits_through_part_nothing(gap_m: float, barred: bool) -> None:
    """Along, across and aslant of the cells of the flood fill."""
    for angle in (0.0, 0.3, pi / 4, 1.1):
        c, s = np.cos(angle), np.sin(angle)
        box = [(2.0, -2.0), (2.0, 2.0), (-2.0, 2.0), (-2.0, -2.0), (2.0 - gap_m, -2.0)]
        turned = [(c * x - s * y, s * x + c * y) for x, y in box]
        walls = [(*a, *b) for a, b in pairwise(turned)]
        assert (parted([(0.0, 0.0), (9.0, 1.0)], walls) is not None) == barred, angle
