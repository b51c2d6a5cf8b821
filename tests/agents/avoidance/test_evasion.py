"""The distance that an evasion would keep from what moves, and whether it would drive at it."""

from math import inf

import pytest

from lfa.agents.avoidance.decision import Action
from lfa.agents.avoidance.evasion import (
    CLEARANCE_M,
    EVASIONS,
    LOOK_S,
    MOST_CARE,
    SLOW,
    STEP_S,
    Evasion,
    apart_m,
    care_of,
    closest_m,
    kept_m,
    leads_to,
    side_of,
)
from lfa.agents.perception.obstacle_tracker import Feature
from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc

BEND = Evasion(Action.LEFT, 0.45, 0.9, 1.0)
BEND_TWIST = Twist(0.45, 0.9)
BEND_S = 1.0 / 0.9


def moves(x: float, y: float, vx: float = 0.0, vy: float = 0.0, radius_m: float = 0.1) -> Feature:
    return Feature("moving", x, y, radius_m, vx, vy)


def on_the_way_of_the_bend(later_s: float, radius_m: float = 0.1) -> Feature:
    """Something at rest where a robot is that began `BEND` at the origin `later_s` ago."""
    straight = along_arc(along_arc(Pose2D(), BEND_TWIST, BEND_S), Twist(0.45, 0.0), later_s - BEND_S)
    return moves(straight.x, straight.y, radius_m=radius_m)


def test_the_distance_to_several_is_that_to_the_nearest_surface() -> None:
    near, far = moves(1.0, 1.0, 0.5, 0.0, radius_m=0.3), moves(9.0, 0.0)
    assert apart_m([far, near], Pose2D(0.0, 1.0), 2.0) == pytest.approx(2.0 - 0.3)


@pytest.mark.parametrize(
    ("x", "y", "v_mps", "leads"),
    [(0.8, 0.4, 0.5, True), (0.4, 0.8, 0.5, False), (1.2, 2.4, 0.5, False), (0.8, 0.4, -0.5, False),
     (-0.8, 0.4, -0.5, True), (-0.4, 0.8, -0.5, False), (0.8, 0.4, 0.0, False)],
)  # fmt: skip
def test_a_motion_leads_to_what_is_less_than_60_degrees_off_it_at_any_distance(
    x: float, y: float, v_mps: float, leads: bool
) -> None:
    assert leads_to(moves(x, y), Pose2D(), Twist(v_mps, 0.3)) is leads


@pytest.mark.parametrize(("evasion", "side"), [(BEND, 1.0), (EVASIONS[1], -1.0)])
def test_the_side_of_a_bend_has_the_sign_of_its_yaw_rate(evasion: Evasion, side: float) -> None:
    assert side_of(evasion) == side


def test_to_wait_does_more_than_to_slow_down_and_to_turn_does_most() -> None:
    assert care_of(Action.SLOW) < care_of(Action.WAIT) < care_of(Action.RIGHT) == MOST_CARE


def test_an_obstacle_that_goes_away_comes_no_nearer_wherever_on_the_map_it_is() -> None:
    assert closest_m([moves(5.7, 3.0, 0.8)], Pose2D(5.0, 3.0), Twist(0.5, 0.0)) == inf


def test_a_conflict_of_the_first_step_counts() -> None:
    assert closest_m([moves(1.0, 0.0, -1.0 / STEP_S)], Pose2D(), STILL, STEP_S) == pytest.approx(-0.1)


def test_what_comes_near_after_the_time_that_is_asked_for_does_not_count() -> None:
    assert closest_m([moves(2.0, 0.0, -1.0 / STEP_S)], Pose2D(), STILL, STEP_S) == pytest.approx(1.0 - 0.1)


def test_an_evasion_meets_what_stands_on_the_straight_way_after_its_bend() -> None:
    assert kept_m([on_the_way_of_the_bend(4.0)], Pose2D(), BEND, BEND_TWIST) < 0.0


def test_an_evasion_is_not_looked_at_beyond_the_time_for_choosing() -> None:
    beyond = on_the_way_of_the_bend(LOOK_S + 2.0)  # 0.9 m after the place of the last moment
    assert kept_m([beyond], Pose2D(), BEND, BEND_TWIST) == CLEARANCE_M


def test_more_than_the_clearance_is_not_better_than_the_clearance() -> None:
    assert kept_m([moves(9.0, 0.0)], Pose2D(), SLOW, Twist(0.1, 0.0)) == CLEARANCE_M


def test_what_turns_again_and_again_comes_no_nearer_than_it_goes_in_the_time_for_which_it_keeps_its_course() -> None:
    comes = Feature("moving", 3.0, 0.0, 0.1, -0.5, 0.0, keeps_s=1.0)
    assert closest_m([comes], Pose2D(), STILL) == pytest.approx(3.0 - 0.5 - 0.1)


def test_an_evasion_reckons_with_the_rest_of_the_time_for_which_a_course_is_kept() -> None:
    """It crosses the straight way behind the bend if it goes on, and stops before if it keeps its course for less."""
    bend = along_arc(Pose2D(), BEND_TWIST, BEND_S)
    met_s = BEND_S + 2.0
    met = along_arc(bend, Twist(0.45, 0.0), 2.0)
    kept = {
        keeps_s: kept_m([Feature("moving", met.x + 0.8 * met_s, met.y, 0.1, -0.8, 0.0, keeps_s=keeps_s)],
                        Pose2D(), BEND, BEND_TWIST)
        for keeps_s in (inf, BEND_S + 1.0)
    }  # fmt: skip
    assert kept[inf] < 0.1
    assert kept[BEND_S + 1.0] > 0.5
