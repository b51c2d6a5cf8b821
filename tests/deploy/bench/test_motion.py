"""`lfa bench motion`: its rows and courses, what counts as a good run, and what is told of one that is not."""

from __future__ import annotations

from math import dist, hypot, pi
from pathlib import Path
from random import Random

import numpy as np
import pytest
from msgspec import structs

from lfa.deploy.bench import motion
from lfa.deploy.bench.driving import courses, drawn_worlds, fastest_way, movers, step_time, unknown_maps
from lfa.deploy.bench.driving.course_file import CRUISE_MPS, course_text
from lfa.deploy.bench.driving.one_run import FAILURES, by_cause, complaint, driven, loaded, note, show_failures
from lfa.deploy.bench.driving.shortest_way import shortest_m
from lfa.deploy.bench.driving.unknown_maps import GROUNDS, BenchMap
from lfa.protocol.errors import Refused
from lfa.world.description import maps
from lfa.world.description.load import load, shipped


def test_the_rows_are_those_that_driving_is_judged_by(tmp_path: Path) -> None:
    names = {case.name for case in motion.cases(1, tmp_path)}
    assert {f"scenario/{name}" for name in shipped()} <= names
    assert {
        "course/u_trap/reactive",
        "mover/head_on/explore",
        "unknown/rooms",
        "time/open",
        "step/180 beams",
        "drawn",
    } <= names


@pytest.mark.parametrize("kind", courses.KINDS, ids=lambda kind: kind.name)
def test_each_course_loads_for_each_motion_and_body(kind: courses.CourseKind) -> None:
    for seed, motion_name in enumerate(kind.motions):
        for radius_m in kind.radii_m:
            course = kind.draw(Random(seed), radius_m)
            scenario = loaded(kind.name, course_text(kind.name, course, motion_name, sets=(f"radius_m={radius_m}",)))
            assert len(scenario.world.walls_m) == len(course.walls_m)
            assert scenario.mission.leading.motion == motion_name


@pytest.mark.parametrize("kind", movers.KINDS, ids=lambda kind: kind.name)
def test_each_mover_moves_at_each_of_its_speeds(kind: movers.MoverKind) -> None:
    for seed, wanted in enumerate(kind.speeds_mps, start=1):
        course, mps = movers.drawn(kind, seed)
        world = loaded(kind.name, course_text(kind.name, course, "explore")).world
        assert mps == wanted
        assert world.obstacles and all(one.moves for one in world.obstacles)


@pytest.mark.parametrize("seed", range(1, 13))
def test_a_drawn_world_loads_and_leaves_start_goal_and_a_way_free(seed: int) -> None:
    world = drawn_worlds.drawn(seed)
    assert world == drawn_worlds.drawn(seed)
    text = course_text("drawn", world.course, world.motion, world.robots)
    scenario = loaded("drawn", text, world.sets)  # it refuses what stands on a start or on the goal
    assert len(scenario.world.obstacles) == len(world.course.obstacles) >= 4
    assert scenario.world.lidar.beams in (60, 90, 180, 360)


def test_ground_that_a_board_shuts_off_is_drawn_again() -> None:
    shut = np.array([(4.0, 0.05 * n) for n in range(-99, 100)])
    assert not drawn_worlds.passes(shut, 0.15, 9.0)
    assert drawn_worlds.passes(shut[:120], 0.15, 9.0)


@pytest.mark.parametrize(("theta", "mps", "count"), [(0.0, 0.3, 1), (0.0, 0.0, 0), (pi, 0.3, 0), (pi, -0.3, 1)])
def test_a_robot_drives_into_what_it_touches_only_if_it_moves_towards_it(theta: float, mps: float, count: int) -> None:
    truth = {2: np.array([[0.1 * n, 1.0, 0.0, theta, mps] for n in range(20)])}
    touch = {"kind": "contact", "t": 1.0, "robot": 2, "x": 1.2, "y": 0.05}
    assert movers.driven_into([touch], truth) == count


@pytest.mark.parametrize("ground", GROUNDS, ids=lambda ground: ground.name)
def test_a_pair_is_far_apart_and_has_room_for_the_team(ground: BenchMap) -> None:
    path = unknown_maps.map_of(ground)
    if path is None:
        pytest.skip(f"no shared/{ground.place} beside the checkout or above it")
    [sets] = unknown_maps.pairs(ground, 1)
    scenario, room = load("explore", sets, ground.robots), maps.Room(maps.read(path))
    assert scenario.world.starts is not None
    (x, y, _), goal = scenario.world.starts[0], scenario.mission.goal_m
    apart_m = hypot(x - goal[0], y - goal[1])
    assert len(scenario.world.starts) == ground.robots
    assert apart_m > ground.apart_m - 0.02
    assert min(room.clearance_m(x, y), room.clearance_m(*goal)) > ground.clear_m - 0.01
    assert 0.95 * apart_m < unknown_maps.shortest_on(ground, sets, scenario.mission.radius_m) < 10.0 * apart_m


def test_the_shortest_way_goes_round_a_wall_with_room_for_the_body() -> None:
    cells = np.zeros((40, 40), dtype=np.int16)
    cells[:30, 20] = maps.OCCUPIED
    drawn = maps.Map(cells, 0.1)
    straight, length_m = 2.0, shortest_m(drawn, (1.05, 1.05), (3.05, 1.05), 0.15)
    over_m = 2.0 * hypot(0.85, 2.1) + 0.3
    assert straight < length_m and length_m == pytest.approx(over_m, rel=0.05)
    cells[:, 20] = maps.OCCUPIED
    assert shortest_m(drawn, (1.05, 1.05), (3.05, 1.05), 0.15) == float("inf")


def test_a_map_that_is_not_there_is_left_out_and_said_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(unknown_maps, "GROUNDS", (BenchMap("nowhere", "nowhere.yaml"),))
    with pytest.raises(Refused):
        motion.run(as_json=False, rows="unknown/nowhere*")
    assert "unknown/nowhere is left out" in capsys.readouterr().err


def test_what_falls_short_is_listed_by_cause_with_its_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sets = ["mission.leading.route_m=[[5.0, 0.0]]", "time_limit_s=1.0"]
    for seed in (1, 2):
        with driven(load("straight", sets, 2), seed) as done:
            note("scenario/straight", done, complaint(done.summary), tmp_path)
    [(cause, failures)] = by_cause(tmp_path).items()
    assert cause.startswith("not at the goal after # s") and len(failures) == 2
    assert all((Path(one.folder) / "scenario.toml").is_file() for one in failures)
    capsys.readouterr()
    show_failures(tmp_path, as_json=False)
    assert [line.split(" ")[0] for line in capsys.readouterr().out.splitlines() if line[0] != " "] == ["2"]


@pytest.mark.parametrize(("goal", "limit", "good"), [(1.0, 30.0, True), (5.0, 1.0, False)])
def test_a_run_that_does_not_end_at_its_goal_is_not_good(goal: float, limit: float, good: bool) -> None:
    sets = [f"mission.leading.route_m=[[{goal}, 0.0]]", f"time_limit_s={limit}"]
    with driven(load("straight", sets, 2), 1) as done:
        wrong = complaint(done.summary)
    assert (wrong is None) == good, wrong


def test_the_control_steps_of_a_simulated_team_are_timed() -> None:
    [p99_ms] = step_time.step_ms(until_s=1.0)
    assert p99_ms > 0.0


def test_no_way_in_clutter_is_shorter_than_the_straight_line_and_none_in_time_than_the_cruise_allows() -> None:
    for kind in fastest_way.KINDS:
        timed = kind.draw(Random(1), fastest_way.RADIUS_M)
        line_m = dist(timed.course.route_m[0], timed.course.route_m[-1])
        assert timed.way_m >= line_m
        assert timed.least_s(0.5) == pytest.approx(timed.way_m / CRUISE_MPS + CRUISE_MPS / 0.5)


def test_a_robot_among_obstacles_that_it_knows_takes_hardly_longer_than_any_drive_could(tmp_path: Path) -> None:
    clutter = fastest_way.KINDS[1]
    good, ratio = motion.timed_good(clutter, tmp_path, 1)
    assert good == 1.0 and 0.97 < ratio < clutter.ratio_max


def test_a_run_that_takes_longer_than_the_bar_is_not_good(tmp_path: Path) -> None:
    fast = structs.replace(fastest_way.KINDS[0], ratio_max=0.9)
    assert motion.timed_good(fast, tmp_path, 1)[0] == 0.0
    assert "times the shortest possible time" in (tmp_path / FAILURES).read_text()
