"""Scenarios: shipped ones load and build, bad input is one line, and a seed draws a course that can be driven."""

from __future__ import annotations

import subprocess
import sys
from math import hypot, pi
from pathlib import Path

import pytest

from lfa.protocol.errors import Refused
from lfa.protocol.geometry import distance
from lfa.world.description.load import SCENARIOS, Obstacle, Scenario, draw, load, shipped
from lfa.world.description.placement import gap_to, reach_of, starts_of

NAMES = sorted(path.stem for path in SCENARIOS.glob("*.toml"))
GAP_M_MIN = 1.2


def test_the_four_scenarios_of_the_foundation_are_shipped() -> None:
    assert {"straight", "leader_killed", "paper_path1", "paper_path2"} <= shipped().keys()


@pytest.mark.parametrize("name", ["paper_path1", "paper_path2"])
def test_paper_teams_keep_the_papers_formation_and_nobody_is_killed(name: str) -> None:
    scenario = load(name)
    formation = scenario.mission.formation
    assert scenario.mission.robots == (1, 2, 3, 4)
    assert (formation.separation_m, formation.angle_rad) == (1.2, pytest.approx(pi / 3))
    assert scenario.faults == ()


#        overrides                                             what the line must say
BAD = [
    (["world.lidr.beams=90"], ["world.lidr", "did you mean 'lidar'"]),
    (["mission.limits.v_max=1"], ["mission.limits.v_max = 1", "did you mean 'v_max_mps'"]),
    (["colour=3"], ["colour = 3", "known are title"]),
    (["name='x'"], ["name = x", "no such key"]),
    (["assert.separation_min_m=-1"], ["assert.separation_min_m = -1", "0 or more"]),
    (["world.body.mass_kg=-3"], ["world.body.mass_kg = -3", "from 0.1"]),
    (["world.obstacles=[{center_m=[5,0], radius_m=0.3, mass_kg=-1}]"], ["obstacles[0].mass_kg = -1", "0.01"]),
    (["world.obstacles=[{center_m=[5,0], radius_m=-0.3}]"], ["obstacles[0].radius_m = -0.3"]),
    (["world.obstacles=[{center_m=[5,0]}]"], ["obstacles[0]", "exactly one of the two"]),
    (["world.obstacles=[{center_m=[5,0], radus_m=1}]"], ["obstacles[0].radus_m", "did you mean 'radius_m'"]),
    (["world.obstacles=[{radius_m=1}]"], ["obstacles[0].center_m is missing"]),
    (["world.obstacles=[{center_m=[5,0,1], radius_m=1}]"], ["obstacles[0].center_m = [5, 0, 1]", "length 2"]),
    (["world.obstacles=[{center_m=[5,0], corners_m=[[0,0],[0,1],[1,0]]}]"], ["corners_m", "counter-clockwise"]),
    (["world.obstacles=[{center_m=[5,0], corners_m=[[2,0],[-2,1],[1,-2],[1,2],[-2,-1]]}]"], ["corners_m", "convex"]),
    (["world.obstacles=[{center_m=[5,0], radius_m=1, waypoints_m=[[6,0]]}]"], ["speed_mps = 0", "above 0"]),
    (["world.obstacles=[{center_m=[5,0], radius_m=1, waypoints_m=[[5,0]], speed_mps=1}]"], ["other than center_m"]),
    (["mission.robots=[1,2,2]"], ["mission.robots", "id 2 is given twice"]),
    (["mission.robots=[0,1]"], ["mission.robots", "from 1 upwards"]),
    (["mission.can_lead=[9]"], ["mission.can_lead"]),
    (["world.noise.range_m=nan"], ["world.noise.range_m = nan", "finite"]),
    (["time_limit_s=inf"], ["time_limit_s = inf", "finite"]),
    (["world.physics_hz=20"], ["world.physics_hz = 20", "from 100 to 1000"]),
    (["world.physics_hz=1e9"], ["world.physics_hz", "from 100 to 1000"]),
    (["world.lidar.beams='many'"], ["world.lidar.beams = many", "a whole number, not text"]),
    (["world.lidar.range_min_m=0.6"], ["world.lidar.range_min_m = 0.6", "from 0 to 0.5"]),
    (["radio.loss=1.5"], ["radio.loss = 1.5"]),
    (["world.obstacles=[{center_m=[0.2,0], radius_m=0.3}]"], ["obstacles[0]", "clear of the start of robot 1"]),
    (["world.obstacles=[{center_m=[40,0], radius_m=0.3}]"], ["obstacles[0]", "clear of the goal"]),
    (["world.walls_m=[[-1,0.1,1,0.1]]"], ["walls_m[0]", "clear of the start of robot 1"]),
    (["world.walls_m=[[3,3,3,3]]"], ["walls_m[0]", "two different ends"]),
    (["world.starts=[[0,0,0]]"], ["world.starts = 1 poses", "each of the 4 robots"]),
    (["world.starts=[[0,0,0],[0,0.1,0],[3,0,0],[4,0,0]]"], ["world.starts", "robots 1 and 2", "0.3 m apart"]),
    (["mission=3"], ["mission = 3", "a table, not a whole number"]),
    (["mission.robots.x=3"], ["mission.robots", "a list, not a table"]),
    (["world.obstacles[3].radius_m=1"], ["--set world.obstacles[3].radius_m = 1", "is in none"]),
    (["title.x=1"], ["--set title.x = 1", "is in none"]),
    (["a b=1"], ["--set 'a b=1'", "key=value"]),
    (["nonsense"], ["--set 'nonsense'", "key=value"]),
    (["mission.leading.route_m=[[1,2,]"], ["--set mission.leading.route_m", "TOML value"]),
    (["mission.leading.route_m=[]"], ["mission.leading.route_m", "way-point"]),
    (["mission.formation.side=up"], ["mission.formation.side = up", "one of left, right, column, zigzag"]),
    (["mission.leading.orientations=[{at_m=1, side='up'}]"], ["orientations[0].side = up", "one of left, right"]),
    (["restart.world=always"], ["restart.world = always", "one of never, on-failure"]),
    (["mission.following.gains={b_m=1, k_per_s='x'}"], ["mission.following.gains.k_per_s = x", "a number, not text"]),
]


@pytest.mark.parametrize(("overrides", "says"), BAD, ids=[case[0][0] for case in BAD])
def test_bad_input_is_refused_in_one_line(overrides: list[str], says: list[str]) -> None:
    with pytest.raises(Refused) as refused:
        load("straight", overrides)
    line = str(refused.value)
    assert "\n" not in line
    assert "--set" in line or "straight.toml" in line
    assert all(part in line for part in says), line


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("paper_pth1", ["no scenario 'paper_pth1'", "did you mean 'paper_path1'"]),
        ("zzz", ["no scenario 'zzz'", "paper_path1, paper_path2, "]),
        ("no/such.toml", ["no/such.toml", "No such file"]),
        (".", ["no scenario '.'"]),
    ],
)
def test_an_unknown_scenario_is_refused_in_one_line(name: str, says: list[str]) -> None:
    with pytest.raises(Refused) as refused:
        load(name)
    assert all(part in str(refused.value) for part in says), str(refused.value)


@pytest.mark.parametrize(
    "content", [b"", b"\xff\xfe", b"a = ", b"title = 3", b"[" * 5000, b"title = 'x'\ntime_limit_s = 10\n[mission]\n"]
)
def test_a_broken_file_is_refused_in_one_line_that_names_it(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "broken.toml"
    path.write_bytes(content)
    with pytest.raises(Refused) as refused:
        load(str(path))
    assert str(refused.value).startswith(str(path))
    assert "\n" not in str(refused.value)


def test_an_unreadable_file_is_refused_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(Refused, match="cannot be read"):
        load(f"{tmp_path}/absent.toml")


@pytest.mark.parametrize("robots", [0, -1, 100_000, 10**15])
def test_an_impossible_number_of_robots_is_refused(robots: int) -> None:
    with pytest.raises(Refused, match=f"^--robots {robots}: mission.robots"):
        load("straight", robots=robots)


def test_robots_renumbers_the_team() -> None:
    scenario = load("paper_path1", ["mission.robots=[3,7]"], robots=10)
    assert scenario.mission.robots == tuple(range(1, 11))


def test_set_overrides_any_field() -> None:
    scenario = load("straight", ["world.lidar.beams=90", "mission.formation.side=column", "radio.loss=0.25"])
    assert scenario.world.lidar.beams == 90
    assert scenario.mission.formation.side == "column"
    assert scenario.radio.loss == 0.25


def test_set_reaches_into_lists() -> None:
    scenario = load("paper_path1", ["world.obstacles[2].radius_m=0.4", "mission.leading.route_m[0]=[4.0, 0.1]"])
    assert scenario.world.obstacles[2].radius_m == 0.4
    assert scenario.mission.leading.route_m[0] == (4.0, 0.1)
    with pytest.raises(Refused, match=r"^paper_path1.toml with --set: world.obstacles\[2\].radius_m = -1"):
        load("paper_path1", ["world.obstacles[2].radius_m=-1"])


def test_a_scenario_is_read_without_the_engine() -> None:
    heavy = "print(sorted({'pymunk', 'numpy'} & sys.modules.keys()))"
    code = f"import sys, lfa.world.description.load as s; s.load('paper_path1'); {heavy}; s.shipped(); {heavy}"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said == "[]\n['numpy']\n", "only a scenario with a map needs numpy"


@pytest.mark.parametrize(("side", "y"), [("left", 1.0392), ("right", -1.0392), ("column", 0.0)])
def test_followers_start_in_their_slots(side: str, y: float) -> None:
    poses = starts_of(load("straight", [f"mission.formation.side={side}"]))
    assert poses[0] == type(poses[0])()
    assert poses[1].x == pytest.approx(-0.6 if side != "column" else -1.2)
    assert poses[1].y == pytest.approx(y, abs=1e-4)
    assert poses[3].y == pytest.approx(3 * y, abs=1e-3)


def test_a_zigzag_alternates() -> None:
    poses = starts_of(load("straight", ["mission.formation.side=zigzag"]))
    assert [pose.y for pose in poses] == pytest.approx([0.0, 1.0392, 0.0, 1.0392], abs=1e-4)


def test_the_same_seed_draws_the_same_course_under_any_hash_seed() -> None:
    code = "from lfa.world.description.load import *; print(draw(load('paper_path1'), 7))"
    printed = {
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True, env={"PYTHONHASHSEED": seed}
        ).stdout
        for seed in ("0", "1")
    }
    assert printed == {f"{draw(load('paper_path1'), 7)}\n"}


@pytest.mark.parametrize("name", ["paper_path1", "paper_path2", "leader_killed"])
def test_two_seeds_draw_two_courses(name: str) -> None:
    assert draw(load(name), 1).world != draw(load(name), 2).world


def test_a_clean_scenario_draws_nothing() -> None:
    assert draw(load("straight"), 1) == draw(load("straight"), 2)


@pytest.mark.parametrize("seed", [2**63, -(2**63)])
def test_a_seed_that_no_journal_could_hold_is_refused(seed: int) -> None:
    with pytest.raises(Refused, match=f"--seed {seed}: must be from"):
        draw(load("straight"), seed)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("seed", range(30))
def test_what_is_drawn_stays_within_its_bounds_and_can_be_driven(name: str, seed: int) -> None:
    scenario = load(name)
    drawn, vary = draw(scenario, seed), scenario.world.vary
    for given, placed in zip(scenario.world.obstacles, drawn.world.obstacles, strict=True):
        assert hypot(given.center_m[0] - placed.center_m[0], given.center_m[1] - placed.center_m[1]) <= vary.obstacles_m
    for given_start, start in zip(starts_of(scenario), starts_of(drawn), strict=True):
        assert distance(given_start, start) <= vary.starts_m + 1e-12
        assert abs(given_start.theta - start.theta) <= vary.starts_rad
    fixed = [obstacle for obstacle in drawn.world.obstacles if not obstacle.waypoints_m]
    gaps = [_gap(a, b) for n, a in enumerate(fixed) for b in fixed[:n]]
    assert min(gaps, default=GAP_M_MIN) >= GAP_M_MIN, f"reproduce: draw(load({name!r}), {seed})"
    for pose in starts_of(drawn):
        assert all(gap_to((pose.x, pose.y), obstacle) > 0.5 for obstacle in drawn.world.obstacles)


def test_an_obstacle_that_would_cover_a_start_or_the_goal_is_drawn_again() -> None:
    overrides = [
        "world.obstacles=[{center_m=[1.2, 0], radius_m=0.3}, {center_m=[38.8, 0], radius_m=0.3}]",
        "world.vary.obstacles_m=2.0",
    ]
    scenario: Scenario = load("straight", overrides)
    for seed in range(50):
        near_start, near_goal = draw(scenario, seed).world.obstacles
        assert gap_to((0.0, 0.0), near_start) >= 0.65, seed
        assert gap_to((40.0, 0.0), near_goal) >= 0.65, seed


def _gap(a: Obstacle, b: Obstacle) -> float:
    """At least this far [m] apart: a polygon counts as the circle around it."""
    apart = hypot(a.center_m[0] - b.center_m[0], a.center_m[1] - b.center_m[1])
    return apart - reach_of(a) - reach_of(b)


JACKAL = "[[0.254, 0.215], [-0.254, 0.215], [-0.254, -0.215], [0.254, -0.215]]"


@pytest.mark.parametrize(
    ("corners", "radius_m", "says"),
    [
        ("[[0.254, 0.215], [-0.254, 0.215]]", 0.4, "world.body.footprint_m"),
        ("[[0.3, 0.2], [0.3, -0.2], [-0.3, -0.2], [-0.3, 0.2]]", 0.4, "convex polygon, counter-clockwise"),
        ("[[0.3, 0.2], [-0.3, 0.2], [-0.3, -0.2], [0.0, 0.0], [0.3, -0.2]]", 0.4, "convex polygon"),
        ("[[nan, 0.2], [-0.3, 0.2], [-0.3, -0.2]]", 0.4, "world.body.footprint_m"),
        ("[[0.3, 0.2], [0.1, 0.2], [0.1, -0.2], [0.3, -0.2]]", 0.4, "around the origin"),
        (JACKAL, 0.3, "mission.radius_m = 0.3: must be at least 0.3328"),
    ],
)
def test_a_body_that_cannot_be_is_refused_in_one_line(corners: str, radius_m: float, says: str) -> None:
    with pytest.raises(Refused) as refused:
        load("straight", [f"world.body.footprint_m={corners}", f"mission.radius_m={radius_m}"])
    assert says in str(refused.value) and "\n" not in str(refused.value)


def test_a_body_that_is_a_polygon_is_taken() -> None:
    world = load("straight", [f"world.body.footprint_m={JACKAL}", "mission.radius_m=0.333"]).world
    assert world.body.footprint_m[0] == (0.254, 0.215)


def test_the_robots_know_the_polygon_of_the_simulated_bodies_and_the_other_way_round() -> None:
    told = load("straight", [f"mission.footprint_m={JACKAL}", "mission.radius_m=0.333"])
    built = load("straight", [f"world.body.footprint_m={JACKAL}", "mission.radius_m=0.333"])
    assert told == built
    assert told.mission.footprint_m == told.world.body.footprint_m != ()


def test_robots_are_told_of_no_other_body_than_they_have() -> None:
    other = "[[0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.2, -0.2]]"
    with pytest.raises(Refused) as refused:
        load("straight", [f"mission.footprint_m={other}", f"world.body.footprint_m={JACKAL}", "mission.radius_m=0.333"])
    assert "must be that of mission.footprint_m" in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize(("gap_m", "passes"), [(0.53, True), (0.40, False)])
def test_a_wall_whose_gap_the_polygon_passes_parts_nothing_though_its_circle_would_not(
    gap_m: float, passes: bool
) -> None:
    walls = [[-3, -3, 45, -3], [45, -3, 45, 3], [45, 3, -3, 3], [-3, 3, -3, -3]]
    walls += [[5, -3, 5, -gap_m / 2], [5, gap_m / 2, 5, 3]]
    keys = [f"world.body.footprint_m={JACKAL}", "mission.radius_m=0.333", f"world.walls_m={walls}"]
    if passes:
        assert load("straight", keys, robots=1).mission.half_width_m == 0.215
        return
    with pytest.raises(Refused, match="can be reached, walls part it"):
        load("straight", keys, robots=1)
