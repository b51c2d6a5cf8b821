"""What a robot has heard of others is fresh, stale, or not believed."""

from math import hypot
from random import Random

import pytest
from msgspec.structs import replace

from lfa.agents.perception.obstacle_tracker import Feature
from lfa.agents.perception.shared_obstacles import PARTIAL_TRACK_S, REMOTE_TRACK_S
from lfa.agents.team_state import TeamState
from lfa.protocol.geometry import Pose2D
from lfa.protocol.messages.consensus import Role
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import ObstacleNote, TableRow

AWAY = Pose2D(-5.0, 0.0, 0.0)


def row(seq: int, x: float, life: int = 1) -> TableRow:
    return TableRow(Header("robot2", life, seq, 0.1 * seq), x, 0.0, 0.0, 0.0, 0.0, Role.FOLLOWER)


def told(kind: str, x: float) -> ObstacleNote:
    return ObstacleNote(Header("robot2", 1, 0, 0.0), kind, x, 0.0, 0.25, (0.2, 0.0))


def test_the_newest_row_of_the_newest_life_counts() -> None:
    team = TeamState()
    for heard in (row(3, 3.0), row(2, 2.0), row(3, 9.0), row(0, 5.0, life=2), row(9, 9.0, life=1)):
        team.hear_row(2, heard, 1.0)
    pose = team.pose_of(2, 1.0)
    assert pose is not None
    assert pose.x == 5.0


def test_a_robot_is_where_it_went_on_to_since_its_last_row() -> None:
    team = TeamState()
    for seq in (1, 2):
        team.hear_row(2, row(seq, 0.05 * seq), 1.0 + 0.1 * seq)  # 0.5 m/s
    pose = team.pose_of(2, 1.6)
    assert pose is not None
    assert pose.x == pytest.approx(0.1 + 0.5 * 0.4)


def test_a_stale_row_is_no_place() -> None:
    team = TeamState()
    team.hear_row(2, row(1, 1.0), 1.0)
    assert team.pose_of(2, 3.9) is not None
    assert team.pose_of(2, 4.1) is None


def test_what_another_saw_moving_moves_on_and_is_forgotten() -> None:
    team = TeamState()
    team.obstacles.update(2, told("moving", 1.0), 0.0)
    [feature] = team.obstacles.moving([], AWAY, 0.5)
    assert feature.x == 1.1
    assert team.obstacles.moving([], AWAY, REMOTE_TRACK_S + 0.1) == []


def test_what_one_sees_oneself_counts_once() -> None:
    team = TeamState()
    team.obstacles.update(2, told("moving", 1.0), 0.0)
    own = Feature("moving", 1.2, 0.1, 0.25, 0.2, 0.0)
    assert team.obstacles.moving([own], AWAY, 0.0) == [own]


def test_what_another_saw_moving_is_not_where_one_looks_through() -> None:
    """It has turned since."""
    team = TeamState()
    team.obstacles.update(2, told("moving", 1.0), 0.0)
    assert team.obstacles.moving([], AWAY, 0.5, seen_free=lambda place: place == (1.1, 0.0)) == []
    assert len(team.obstacles.moving([], AWAY, 0.6, seen_free=lambda place: place == (1.1, 0.0))) == 1


def test_what_another_saw_standing_does_not_move() -> None:
    team = TeamState()
    team.obstacles.update(2, told("stationary", 1.0), 0.0)
    assert team.obstacles.moving([], AWAY, 0.1) == []


def test_what_another_saw_moving_is_not_the_robot_itself() -> None:
    team = TeamState()
    team.obstacles.update(2, told("moving", 1.0), 0.0)
    assert team.obstacles.moving([], Pose2D(1.0, 0.1, 0.0), 0.0) == []
    assert len(team.obstacles.moving([], AWAY, 0.0)) == 1


def test_a_robot_can_lead_while_its_newest_row_has_a_place_and_no_trap() -> None:
    team = TeamState()
    assert not team.can_lead(2, 0.0)
    team.hear_row(2, row(1, 0.0), 1.0)
    assert team.can_lead(2, 3.9)
    assert not team.can_lead(2, 4.1)
    team.hear_row(2, replace(row(2, 0.0), stuck=True), 5.0)
    assert not team.can_lead(2, 5.0)
    team.hear_row(2, replace(row(3, 0.0), placed=False), 6.0)
    assert not team.can_lead(2, 6.0)


def test_a_robot_is_stuck_as_long_as_it_says_so() -> None:
    team = TeamState()
    assert not team.stuck(2, 0.0)
    team.hear_row(2, replace(row(1, 0.0), stuck=True), 1.0)
    assert team.stuck(2, 3.9)
    assert not team.stuck(2, 4.1)
    team.hear_row(2, row(2, 0.0), 4.2)
    assert not team.stuck(2, 4.2)


def test_what_another_saw_moving_is_believed_for_longer_where_something_is_seen() -> None:
    team = TeamState()
    team.obstacles.update(2, told("moving", 1.0), 0.0)
    later = REMOTE_TRACK_S + 0.1
    assert team.obstacles.moving([], AWAY, later, lambda x, y, within_m: abs(x - 1.0 - 0.2 * later) < within_m)
    assert team.obstacles.moving([], AWAY, PARTIAL_TRACK_S + 0.1, lambda x, y, within_m: True) == []


def test_nobody_near_is_passed_over_wherever_its_extrapolation_has_come() -> None:
    """What is near is found by the last rows; a robot that drives on comes near between two of them."""
    random, team, robots = Random(3), TeamState(), tuple(range(2, 30))
    for seq, at in ((1, 0.0), (2, 0.5)):
        for robot in robots:
            team.hear_row(robot, replace(row(seq, random.uniform(-6.0, 6.0)), y=random.uniform(-6.0, 6.0)), at)
    for now in (0.5, 0.8, 1.4, 3.0):
        places = {robot: team.pose_of(robot, now) for robot in robots}
        for within_m in (0.5, 1.5, 4.0):
            found = dict(team.near(robots, Pose2D(), within_m, now))
            inside = [robot for robot, at in places.items() if at is not None and hypot(at.x, at.y) <= within_m]
            assert [robot for robot in inside if found.get(robot) != places[robot]] == []
            assert list(found) == sorted(found)


def test_who_is_near_does_not_depend_on_where_the_robot_has_looked_before() -> None:
    """It drives about among others that drive too; a state that heard the same rows and never looked says the same."""
    random, team, robots = Random(5), TeamState(), tuple(range(2, 14))
    heard: list[tuple[int, TableRow, float]] = []
    place = Pose2D()
    for step in range(300):
        now = 0.1 * step
        row_of = replace(row(step, random.uniform(-9.0, 9.0)), y=random.uniform(-9.0, 9.0))
        heard.append((robots[step % len(robots)], row_of, now))
        team.hear_row(*heard[-1])
        place = Pose2D(place.x + random.uniform(-0.6, 0.6), place.y + random.uniform(-0.6, 0.6))
        within_m = random.choice((0.8, 3.0))
        fresh = TeamState()
        for each in heard:
            fresh.hear_row(*each)
        assert team.near(robots, place, within_m, now) == fresh.near(robots, place, within_m, now)
