"""Worlds of other programs: what is read, what a scenario makes of it, and what a damaged file is told."""

from __future__ import annotations

from math import cos, hypot, pi, sin, sqrt
from pathlib import Path

import numpy as np
import pytest

from lfa.deploy.run.simulate import measure
from lfa.deploy.scenario_loading import load_scenario
from lfa.deploy.worlds.drawing import WorldDrawing
from lfa.deploy.worlds.import_command import command, read_world
from lfa.deploy.worlds.sdf import sdf_of
from lfa.deploy.worlds.world_export import export_world, map_of
from lfa.protocol.errors import Refused
from lfa.world.description import maps
from lfa.world.description.load import Scenario, draw

IRSIM = """
world: {height: 10, width: 12, offset: [-1, 0]}
robot:
  - {kinematics: {name: diff}, shape: {name: circle, radius: 0.2}, state: [1, 1, 0], goal: [9, 9, 0]}
  - {number: 2, distribution: {name: random}, shape: {name: circle}}
obstacle:
  - {shape: {name: circle, radius: 1.0}, state: [5, 5, 0]}
  - {shape: {name: rectangle, length: 1.5, width: 1.2}, state: [6, 2, 1]}
  - shape: {name: linestring, vertices: [[2, 5], [2, 7], [3, 7]]}
  - shape: {name: polygon, vertices: [[8, 4], [8, 6], [9, 6], [9, 4]]}
"""
MOVINGAI = "type octile\nheight 8\nwidth 12\nmap\n" + "\n".join(
    ("@" * 12, *["@..........@"] * 2, "@....TT....@", "@....TT....@", *["@..........@"] * 2, "@" * 12)
)
SDF = """<?xml version="1.0"?>
<sdf version="1.9"><world name="hall">
  <model name="floor"><link name="l"><collision name="c"><geometry><plane/></geometry></collision></link></model>
  <model name="crate"><pose>2 1 0.5 0 0 1.570796</pose><link name="l"><pose>1 0 0 0 0 0</pose>
    <collision name="c"><geometry><box><size>2 1 1</size></box></geometry></collision></link></model>
  <model name="post"><pose>6 1 0.5 0 0 0</pose><link name="l">
    <collision name="c"><geometry><cylinder><radius>0.3</radius><length>1</length></cylinder></geometry></collision>
  </link></model>
  <model name="wall"><pose>0 5 1 0 0 0</pose><link name="l">
    <collision name="c"><geometry><box><size>8 0.04 2</size></box></geometry></collision></link></model>
  <model name="lamp"><pose>0 0 3 0 0 0</pose><link name="l">
    <collision name="c"><geometry><box><size>1 1 0.1</size></box></geometry></collision></link></model>
  <model name="robot"><link name="l"><collision name="c"><geometry><mesh/></geometry></collision></link></model>
</world></sdf>
"""
PLAN = """<svg xmlns="http://www.w3.org/2000/svg" width="12m" viewBox="0 0 1200 800">
  <path d="M0 0 h1200 v800 H0 V0"/>
  <g transform="translate(600 400) rotate(90)"><rect x="-100" y="-50" width="200" height="100"/></g>
  <circle cx="300" cy="200" r="50"/>
  <polyline points="900,100 900,300 1000,300"/>
  <circle id="start" cx="150" cy="650" r="5"/><circle id="goal" cx="1050" cy="650" r="5"/>
  <text>plan</text>
</svg>"""
FILES = {"w.yaml": IRSIM, "w.map": MOVINGAI, "w.sdf": SDF, "w.svg": PLAN}


def written(tmp_path: Path, name: str, text: str | bytes) -> Path:
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def read(tmp_path: Path, name: str) -> WorldDrawing:
    return read_world(written(tmp_path, name, FILES[name]))


def scenario_of(tmp_path: Path, file: Path, **options: str | int | float) -> Scenario:
    out = tmp_path / "scenario.toml"
    assert command(file, out, **options) == 0  # type: ignore[arg-type]
    return load_scenario(str(out))


def test_an_irsim_world_has_its_border_its_bodies_and_the_way_of_its_first_robot(tmp_path: Path) -> None:
    drawing = read(tmp_path, "w.yaml")
    assert (drawing.start, drawing.goal, drawing.robots, drawing.radius_m) == ((1.0, 1.0), (9.0, 9.0), 1, 0.2)
    assert len(drawing.walls) == 4 + 2
    circle, box, square = drawing.obstacles
    assert (circle.center_m, circle.radius_m) == ((5.0, 5.0), 1.0)
    assert box.center_m == pytest.approx((6.0, 2.0))
    assert box.corners_m is not None
    assert max(hypot(*corner) for corner in box.corners_m) == pytest.approx(hypot(0.75, 0.6), abs=1e-5)
    assert square.center_m == pytest.approx((8.5, 5.0))
    assert drawing.skipped == ["robot[1]: 2 places that IR-SIM draws by itself"]


def test_a_movingai_map_is_the_outline_of_what_blocks_the_first_row_on_top(tmp_path: Path) -> None:
    walls = set(read(tmp_path, "w.map").walls)
    assert {(2.5, 1.5, 3.5, 1.5), (2.5, 2.5, 3.5, 2.5), (2.5, 1.5, 2.5, 2.5), (3.5, 1.5, 3.5, 2.5)} <= walls
    assert {(0.5, 0.5, 5.5, 0.5), (0.5, 3.5, 5.5, 3.5)} <= walls


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"start": "100,2"}, r"start \(100, 2\): outside of the map, must be from 0, 0 to"),
        ({"goal": "-5,1"}, r"goal \(-5, 1\): outside of the map"),
        ({"unit_m": 0.1}, "no room for a robot is in it"),
    ],
)
def test_beyond_the_cells_of_a_map_there_is_no_ground(
    tmp_path: Path, options: dict[str, str | float], said: str
) -> None:
    with pytest.raises(Refused, match=said):
        scenario_of(tmp_path, written(tmp_path, "w.map", MOVINGAI), **options)


def test_an_sdf_world_has_what_a_robot_on_the_floor_meets(tmp_path: Path) -> None:
    drawing = read(tmp_path, "w.sdf")
    crate, post = drawing.obstacles
    assert crate.center_m == pytest.approx((2.0, 2.0), abs=1e-5)
    assert crate.corners_m is not None
    assert max(x for x, _ in crate.corners_m) == pytest.approx(0.5, abs=1e-5)
    assert (post.center_m, post.radius_m) == ((6.0, 1.0), 0.3)
    assert drawing.walls == [(-4.0, 5.0, 4.0, 5.0)]
    assert drawing.skipped == ["model 'robot', collision 'c': mesh"]


def test_a_drawing_has_its_size_its_transforms_and_y_up(tmp_path: Path) -> None:
    drawing = read(tmp_path, "w.svg")
    assert (drawing.start, drawing.goal) == ((1.5, -6.5), (10.5, -6.5))
    box, circle = drawing.obstacles
    assert (circle.center_m, circle.radius_m) == (pytest.approx((3.0, -2.0)), pytest.approx(0.5))
    assert box.center_m == pytest.approx((6.0, -4.0))
    assert box.corners_m is not None
    assert max(y for _, y in box.corners_m) == pytest.approx(1.0)
    assert (9.0, -1.0, 9.0, -3.0) in drawing.walls
    assert drawing.skipped == ["<text>"]


def test_a_path_with_curves_follows_them(tmp_path: Path) -> None:
    arc = "M0 0 C0 55.2 44.8 100 100 100 S200 55.2 200 0 q-50 -20 -100 0 t-100 0 Z"
    drawing = read_world(written(tmp_path, "w.svg", f'<svg><path d="{arc}"/></svg>'))
    points = [wall[:2] for wall in drawing.walls]
    for angle in (0.25 * pi, 0.75 * pi):
        x, y = 1.0 + cos(angle), -sin(angle)
        assert min(hypot(x - px, y - py) for px, py in points) < 0.15


@pytest.mark.parametrize(
    ("path", "middle"),
    [
        ("M0 0 A100 100 0 0 1 200 0", (1.0, 1.0)),
        ("M0 0 a100 100 0 01200 0", (1.0, 1.0)),
        ("M0 0 A100 100 0 0 0 200 0", (1.0, -1.0)),
        ("M0 0 A10 10 0 0 1 200 0", (1.0, 1.0)),
        ("M0 0 A100 50 0 0 1 200 0", (1.0, 0.5)),
        ("M0 0 A50 100 90 0 1 200 0", (1.0, 0.5)),
        ("M0 0 A100 100 0 1 1 100 -100", (-sqrt(0.5), 1.0 + sqrt(0.5))),
    ],
)
def test_an_arc_passes_through_its_middle_and_keeps_its_distance(
    tmp_path: Path, path: str, middle: tuple[float, float]
) -> None:
    drawing = read_world(written(tmp_path, "w.svg", f'<svg><path d="{path}"/></svg>'))
    points = [wall[:2] for wall in drawing.walls]
    assert min(hypot(x - middle[0], y - middle[1]) for x, y in points) < 0.15


def test_a_path_that_closes_on_fewer_than_three_corners_is_a_line_or_nothing(tmp_path: Path) -> None:
    drawing = read_world(written(tmp_path, "w.svg", '<svg><path d="M5 5 z M0 0 L900 0 z"/></svg>'))
    assert drawing.walls == [(0.0, 0.0, 9.0, 0.0)]


def test_a_dot_is_left_out_and_named(tmp_path: Path) -> None:
    drawing = read_world(written(tmp_path, "w.svg", "<svg><circle cx='100' cy='-200' r='0.4'/></svg>"))
    assert (drawing.obstacles, drawing.skipped) == ([], ["circle of radius 0.004 m at 1, 2"])


@pytest.mark.parametrize("name", FILES)
def test_an_imported_world_is_accepted_and_driven(tmp_path: Path, name: str) -> None:
    scenario = scenario_of(tmp_path, written(tmp_path, name, FILES[name]), robots=2)
    summary = measure(scenario, 0).summary
    assert summary.outcome == "goal_reached", f"lfa import {name}; lfa sim: {summary.reason}"
    assert sum(robot.contacts for robot in summary.robots) == 0


def test_a_ros_map_of_nav2_is_imported(tmp_path: Path) -> None:
    shared = Path(__file__).parents[4] / "shared" / "data" / "maps" / "tb3_sandbox.yaml"
    if not shared.is_file():
        pytest.skip("no maps of Nav2 here")
    scenario = scenario_of(tmp_path, shared, robots=2, start="-2,-0.5", goal="2,0.5")
    assert scenario.mission.goal_m == (2.0, 0.5)
    assert len(scenario.world.walls_m) > 50


@pytest.mark.parametrize("name", ["paper_path1", "dead_end", "straight"])
def test_what_is_exported_as_sdf_comes_back(tmp_path: Path, name: str) -> None:
    scenario = load_scenario(name)
    drawn = draw(scenario, scenario.seed)
    if not (drawn.world.walls_m or drawn.world.obstacles):
        assert "<model" not in sdf_of(drawn)
        return
    folder, files = export_world("sdf", name, tmp_path / "sdf")
    back = read_world(folder / files[0])
    assert np.allclose(back.walls, drawn.world.walls_m or np.empty((0, 4)), atol=2e-5) or not drawn.world.walls_m
    assert len(back.walls) == len(drawn.world.walls_m)
    assert len(back.obstacles) == len(drawn.world.obstacles)
    for one, other in zip(back.obstacles, drawn.world.obstacles, strict=True):
        assert (one.radius_m, one.corners_m is None) == (other.radius_m, other.corners_m is None)
        shift = np.subtract(one.center_m, other.center_m)
        assert np.allclose(np.add(one.corners_m or [[0, 0]], shift), other.corners_m or [[0, 0]], atol=2e-5)


def test_what_is_exported_as_a_ros_map_comes_back(tmp_path: Path) -> None:
    scenario = load_scenario("paper_path1")
    ground = map_of(draw(scenario, scenario.seed))
    folder, _ = export_world("map", "paper_path1", tmp_path / "map")
    back = maps.read(folder / "map.yaml")
    assert np.array_equal(back.occupied, ground.occupied)
    assert back.origin == pytest.approx(ground.origin, abs=1e-5)
    assert {*maps.walls(back)} <= {*read_world(folder / "map.yaml").walls}


BOMB = '<!DOCTYPE sdf [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><sdf>&b;</sdf>'
BOX = (
    "<sdf><model name='m'><link><collision><geometry><box><size>{}</size></box></geometry></collision></link></model>"
    "</sdf>"
)
DAMAGED: list[tuple[str, str | bytes, str]] = [
    ("w.sdf", BOMB, "declares the entity 'a'"),
    ("w.svg", BOMB.replace("sdf", "svg"), "declares the entity 'a'"),
    ("w.sdf", "<sdf>" + "<a>" * 200 + "</a>" * 200 + "</sdf>", "in one another"),
    ("w.sdf", "<sdf><model>", "line 1: no element found"),
    ("w.sdf", "", "must be well-formed XML"),
    ("w.sdf", "<svg/>", "must be <sdf>"),
    ("w.sdf", BOX.format("1 1"), "size of the box: must be three numbers"),
    ("w.sdf", BOX.format("1 nan 1"), "must be a number up to"),
    ("w.sdf", BOX.format("1 1e300 1"), "must be a number up to"),
    ("w.sdf", BOX.format("1 -1 1"), "must be three numbers [m] above 0"),
    ("w.sdf", "<sdf/>", "nothing stands in it"),
    ("w.sdf", b"\xff\xfe\x00", "no text in UTF-8"),
    ("w.svg", "<svg><rect width='1'/></svg>", "must be above 0"),
    ("w.svg", "<svg><circle cx='1' r='inf'/></svg>", "must be a number up to"),
    ("w.svg", "<svg><polygon points='1,2 3'/></svg>", "must be pairs"),
    ("w.svg", "<svg><path d='M0 0 A1 1 0 0 2 2 2'/></svg>", "the flag 2: must be 0 or 1"),
    ("w.svg", "<svg><path d='M0 0 B1 1'/></svg>", "command B: must be one of"),
    ("w.svg", "<svg><path d='L1 1'/></svg>", "before the first M"),
    ("w.svg", "<svg><path d='M1 1 L2'/></svg>", "too many or too few"),
    ("w.svg", "<svg><g transform='spin(3)'><line x2='9'/></g></svg>", "must be translate, scale"),
    ("w.svg", "<svg viewBox='0 0 1' width='1m'/>", "nothing stands in it"),
    ("w.map", "type octile\nheight 2\nwidth 3\nmap\n...\n..", "line 6: 2 cells"),
    ("w.map", "type octile\nheight 2\nwidth 3\nmap\n...", "the file has 1 rows"),
    ("w.map", "type octile\nheight 2\nwidth 3\nmap\n.x.\n...", "cell 'x'"),
    ("w.map", "type octile\nheight 99999999999\nwidth 3\nmap\n", "must be a whole number from 1 to"),
    ("w.map", "hello", "must be `type`"),
    ("w.yaml", "a: &a [1]\nworld: *a", "an alias"),
    ("w.yaml", "world: " + "[" * 400, "must be"),
    ("w.yaml", "world: [", "line 1: "),
    ("w.yaml", "- 1", "must be YAML with the keys"),
    ("w.yaml", "robot: []", "world is missing"),
    ("w.yaml", "world: {height: .nan}", "world.height = nan"),
    ("w.yaml", "world: {height: -3}", "must be above 0"),
    ("w.yaml", "world: {}\nobstacle: [{shape: {name: circle, radius: 1e9}}]", "obstacle[0].shape.radius"),
    ("w.yaml", "world: {}\nobstacle: [{shape: {name: circle}, state: [1]}]", "must be a list of at least 2"),
    ("w.yaml", "world: {}\nobstacle: [3]", "obstacle[0] = 3"),
    ("w.yaml", "world: {}\nobstacle: [{number: 1000000000}]", "must be a whole number from 1 to 500"),
    ("w.yaml", "world: {}\nrobot: [{state: [5, 5], goal: [50, 5]}]", "goal (50, 5): no room for a robot there"),
    ("w.yaml", "world: {width: 6, height: 0.5}\nrobot: {state: [3, 0.25], goal: [5, 0.25]}", "no room for a robot"),
    ("w.yaml", "world: {width: 3, height: 3}", "too short for 4 robots"),
    ("w.txt", "", "must be one of .yaml"),
]


@pytest.mark.parametrize(("name", "text", "why"), DAMAGED)
def test_a_damaged_file_is_told_in_one_line_and_nothing_is_written(
    tmp_path: Path, name: str, text: str | bytes, why: str
) -> None:
    file = written(tmp_path, name, text)
    with pytest.raises(Refused) as refused:
        command(file, tmp_path / "out.toml")
    said = str(refused.value)
    assert why in said
    assert said.startswith(str(file))
    assert "\n" not in said
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_what_is_there_already_is_not_written_over(tmp_path: Path) -> None:
    file, out = written(tmp_path, "w.map", MOVINGAI), written(tmp_path, "out.toml", "mine")
    with pytest.raises(Refused, match="exists already"):
        command(file, out)
    with pytest.raises(Refused, match="must be a new or empty folder"):
        export_world("sdf", "straight", tmp_path)
    assert out.read_text() == "mine"


CRATE = (
    "<link name='l'><collision name='c'><pose>0 0 0.5 0 0 0</pose>"
    "<geometry><box><size>1 1 1</size></box></geometry></collision></link>"
)


def test_models_in_models_and_included_ones_stand_where_all_poses_lead(tmp_path: Path) -> None:
    """As Gazebo's own worlds are made: a world of includes, with the models in folders beside it."""
    shelf = tmp_path / "models" / "shelf"
    shelf.mkdir(parents=True)
    written(shelf, "model.sdf", f"<sdf><model name='shelf'><pose>9 9 0 0 0 0</pose>{CRATE}</model></sdf>")
    inner = f"<model name='in'><pose>0 2 0 0 0 0</pose>{CRATE}</model>"
    here = "<include><uri>model://shelf</uri></include>"
    there = "<include><uri>model://shelf</uri><pose>4 0 0 0 0 0</pose></include>"
    missing = "<include><uri>model://../../secret</uri></include>"
    folder = tmp_path / "worlds"
    folder.mkdir()
    world = f"<sdf><world><model name='out'><pose>1 0 0 0 0 0</pose>{inner}</model>{here}{there}{missing}</world></sdf>"
    drawing = read_world(written(folder, "w.world", world))
    assert [one.center_m for one in drawing.obstacles] == [(1.0, 2.0), (9.0, 9.0), (4.0, 0.0)]
    assert drawing.skipped == ["include model://../../secret"]


def test_a_model_that_includes_itself_ends(tmp_path: Path) -> None:
    folder = tmp_path / "m"
    folder.mkdir()
    me = "<include><uri>model://m</uri></include>"
    drawing = read_world(written(folder, "model.sdf", f"<sdf><model name='m'>{CRATE}{me}{me}</model></sdf>"))
    assert 1 < len(drawing.obstacles) < 1000
    assert "include model://m" in drawing.skipped


def test_a_world_whose_models_are_not_here_says_which(tmp_path: Path) -> None:
    file = written(tmp_path, "w.world", "<sdf><world><include><uri>model://house</uri></include></world></sdf>")
    with pytest.raises(Refused, match=r"nothing stands in it.*left out: include model://house"):
        command(file, tmp_path / "out.toml")


def test_of_several_shapes_and_goals_in_irsim_each_body_has_its_own_and_the_robot_the_first(tmp_path: Path) -> None:
    shapes = "[{name: circle, radius: 1.5}, {name: circle, radius: 0.5}]"
    obstacles = f"obstacle:\n  - {{number: 3, state: [[20, 20], [30, 20], [40, 20]], shape: {shapes}}}\n"
    robot = "robot: {state: [1, 1, 0], goal: [[[9, 8, 0], [2, 4, 1]]]}\n"
    drawing = read_world(written(tmp_path, "w.yaml", f"world: {{width: 50, height: 50}}\n{robot}{obstacles}"))
    assert [one.radius_m for one in drawing.obstacles] == [1.5, 0.5, 0.5]
    assert drawing.goal == (9.0, 8.0)
