"""A way-point with something on it is passed at the nearest free place within a stated distance."""

from __future__ import annotations

from math import cos, hypot, pi, sin
from pathlib import Path

import pytest

from lfa.agents.leading.free_place import FREE_WITHIN_M, MARGIN_M, TAKEN_S, FreePlace
from lfa.deploy.analysis.run_data import Run
from lfa.deploy.faults.script import parse_all
from lfa.deploy.run.simulate import run
from lfa.protocol.geometry import Point, Pose2D
from lfa.world.description.load import load

RADIUS_M = 0.15
GOAL = (5.0, 0.0)
HERE = Pose2D(4.0, 0.0, 0.0)


def body(radius_m: float) -> list[Point]:
    """The near side of a round body on the goal, as seen from `HERE` in `base_link`."""
    angles = [pi / 2 + pi * n / 60 for n in range(61)]
    return [(1.0 + radius_m * cos(a), radius_m * sin(a)) for a in angles]


def found(points: list[Point], pose: Pose2D = HERE) -> tuple[FreePlace, Point | None]:
    place = FreePlace(RADIUS_M)
    assert place.look(GOAL, points, pose, 10.0) is None
    return place, place.look(GOAL, points, pose, 10.0 + TAKEN_S)


def test_a_body_on_the_goal_leaves_the_nearest_free_place_on_the_way_to_it() -> None:
    _, place = found(body(RADIUS_M))
    assert place is not None
    apart_m = hypot(place[0] - GOAL[0], place[1] - GOAL[1])
    assert 2.0 * RADIUS_M + MARGIN_M <= apart_m <= 2.0 * RADIUS_M + MARGIN_M + 0.06
    assert place[1] == pytest.approx(0.0)


def test_a_goal_with_room_for_a_robot_is_not_taken() -> None:
    assert found([(1.0 + 0.2, 0.0), (1.0, 0.25)])[1] is None
    assert found([])[1] is None


def test_what_passes_over_the_goal_does_not_take_it() -> None:
    place = FreePlace(RADIUS_M)
    for now in (0.0, 1.0, 2.0):
        assert place.look(GOAL, body(RADIUS_M), HERE, now) is None
    assert place.look(GOAL, [], HERE, 2.9) is None
    assert place.look(GOAL, body(RADIUS_M), HERE, 3.1) is None


def test_without_a_free_place_near_the_goal_none_is_left() -> None:
    far = Pose2D(5.0 - FREE_WITHIN_M - 0.3, 0.0, 0.0)
    filled = [(0.1 * n, 0.1 * m) for n in range(3, 15) for m in range(-3, 4)]
    place, where = found(filled, far)
    assert where is None
    assert place.none_left


def test_a_team_whose_leader_died_on_the_goal_ends_beside_it(tmp_path: Path) -> None:
    settings = ["mission.leading.route_m=[[4.0, 0.0]]", "faults=[]", "time_limit_s=60.0"]
    scenario = load("straight", settings, 3)
    ended = run(scenario, 1, tmp_path / "run", parse_all(scenario.mission, (), ["kill leader at 9.5 s"]))
    again = (
        "lfa sim straight --robots 3 --seed 1 --set mission.leading.route_m=[[4.0,0.0]] --fault 'kill leader at 9.5 s'"
    )
    assert ended.summary.outcome == "goal_reached", again
    truth = Run(ended.folder).truth
    dead, leader = truth[1][-1], truth[2][-1]
    assert hypot(dead[1] - 4.0, dead[2]) < 2.0 * RADIUS_M, f"{again}: the body does not lie on the goal"
    assert hypot(leader[1] - 4.0, leader[2]) <= FREE_WITHIN_M, again
    assert not any(line["kind"] == "contact" for line in Run(ended.folder).events), again
