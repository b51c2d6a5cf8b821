"""Each row of the decision table, by a situation that only it answers."""

from math import inf

import pytest

from lfa.agents.avoidance.decision import TABLE, Situation, decide

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


def test_who_is_barred_on_all_sides_has_no_row() -> None:
    assert decide(S("wall", 0.1, left_m=0.1, right_m=0.1, rear_m=0.1, back_m=0.1)) is None
