"""Each row of the decision table, by a situation that only it answers."""

from math import inf

import pytest

from lfa.agents.avoidance.decision import TABLE, Class, Situation, decide

S = Situation
CASES = [
    (S("moving", 2.0, closest_m=0.7), "continue"),
    (S("moving", 2.0, closest_m=0.5), "give_way"),
    (S("wall", 1.0, left_m=0.6, right_m=0.1), "aside"),
    (S("wall", 1.0, left_m=0.1, right_m=0.1, rear_m=1.0), "u_turn"),
    (S("wall", 0.1, left_m=1.0, back_m=1.0), "back"),
    (S("ditch", 1.0, 0.04, crossable=True), "overcome"),
    (S("ditch", 1.0, 0.4, left_m=1.0), "aside"),
    (S("ditch", 1.0, 0.4, left_m=0.1, right_m=0.1), "u_turn"),
    (S("pothole", 1.0, 0.04, crossable=True), "overcome"),
    (S("pothole", 1.0, 0.4), "aside"),
    (S("pothole", 1.0, inf), "u_turn"),
    (S("stationary", 1.0, 0.4), "aside"),
    (S("stationary", 1.0, 0.4, left_m=0.1, right_m=0.1), "u_turn"),
    (S("stationary", 1.0, inf), "creep"),
    (S("stationary", 1.0, inf, crept=True), "u_turn"),
    (S("bump", 1.0, 0.1, crossable=True), "climb"),
    (S("bump", 1.0, 0.1), "aside"),
    (S("bump", 1.0, 0.1, left_m=0.1, right_m=0.1), "u_turn"),
]


@pytest.mark.parametrize(("situation", "action"), CASES)
def test_the_situation_is_answered(situation: Situation, action: str) -> None:
    row = decide(situation)
    assert row is not None
    assert row.action == action


def test_every_row_is_reached_by_a_case() -> None:
    assert {id(decide(situation)) for situation, _ in CASES} == {id(row) for row in TABLE}


def test_obstacles_update_speed_and_position_and_the_environment_the_angle() -> None:
    """The paper's two strategies (section 3.2)."""
    for row in TABLE:
        obstacle = row.kind in ("stationary", "moving")
        assert row.updates == ("speed and position" if obstacle else "angle")


@pytest.mark.parametrize(
    ("kind", "width_m"),
    [("wall", 0.0), ("ditch", 0.4), ("pothole", inf), ("stationary", 0.4), ("stationary", inf), ("bump", 0.4)],
)
def test_who_is_barred_on_all_sides_has_no_row(kind: Class, width_m: float) -> None:
    barred = S(kind, 0.1, width_m, left_m=0.1, right_m=0.1, rear_m=0.1, back_m=0.1, crept=True)
    assert decide(barred) is None


@pytest.mark.parametrize(
    ("situation", "action"),
    [
        (S("moving", 2.0, closest_m=0.6), "continue"),
        (S("wall", 0.3, left_m=0.5, right_m=0.1), "aside"),
        (S("wall", 0.3, left_m=0.1, right_m=0.1, rear_m=0.2), "u_turn"),
        (S("wall", 0.2, back_m=0.2), "back"),
    ],
)
def test_room_that_is_just_enough_is_enough_and_a_turn_needs_more(situation: Situation, action: str) -> None:
    row = decide(situation)
    assert row is not None
    assert row.action == action


@pytest.mark.parametrize(("kind", "action"), [("ditch", "aside"), ("pothole", "u_turn"), ("bump", "aside")])
def test_what_could_be_crossed_is_not_crossed_while_its_far_edge_is_out_of_sight(kind: Class, action: str) -> None:
    row = decide(S(kind, 1.0, inf, crossable=True))
    assert row is not None
    assert row.action == action
