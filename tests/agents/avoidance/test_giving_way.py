"""What a robot that gives way remembers, how it chooses among evasions, and how wary it is of what passes near."""

from math import cos, hypot, pi, sin

import pytest

from lfa.agents.avoidance.decision import Action
from lfa.agents.avoidance.moving_obstacle import HOLD_S, WAIT_S_MAX, WARY_S, Crossing
from lfa.agents.perception.obstacle_tracker import Feature
from lfa.protocol.geometry import STILL, Pose2D, Twist, compose, wrap

DRIVES = Twist(0.5, 0.0)
RADIUS_M = 0.25
POSES = (Pose2D(), Pose2D(5.0, 3.0, 0.7))
RING = [(0.3 * cos(n * pi / 12), 0.3 * sin(n * pi / 12)) for n in range(24)]
"""Points [m] of what stands all round a robot."""


def comes(x: float, y: float, vx: float, vy: float, pose: Pose2D = POSES[0]) -> Feature:
    """Return something that moves, its place and its velocity as the robot at `pose` sees them."""
    place, way = compose(pose, Pose2D(x, y)), compose(Pose2D(0.0, 0.0, pose.theta), Pose2D(vx, vy))
    return Feature("moving", place.x, place.y, RADIUS_M, way.x, way.y)


def head_on(pose: Pose2D = POSES[0]) -> list[Feature]:
    """Return what makes a robot at `pose` bend to the right: it comes a little to the left of it."""
    return [comes(2.0, 0.05, -0.4, 0.0, pose)]


def slow_is_enough() -> list[Feature]:
    return [comes(2.0, -1.3, 0.0, 0.25)]


def impatient() -> Crossing:
    """Return the behaviour of a robot that has waited for the longest time."""
    crossing = Crossing()
    for now in (0.0, WAIT_S_MAX + 0.1):
        crossing.give_way([comes(1.5, -0.9, 0.0, 0.15)], Pose2D(), DRIVES, now)
    return crossing


def action_of(crossing: Crossing) -> Action | None:
    return None if crossing.decision is None else crossing.decision.action


def test_a_robot_is_patient_before_its_first_conflict() -> None:
    assert Crossing().patient


def test_after_the_longest_wait_a_robot_gives_way_to_nothing() -> None:
    crossing = impatient()
    assert (crossing.patient, crossing.decision) == (False, None)


def test_the_end_of_a_conflict_makes_a_robot_patient_again() -> None:
    crossing = impatient()
    crossing.give_way([], Pose2D(), DRIVES, WAIT_S_MAX + 0.2)
    assert crossing.patient


def test_what_was_waited_for_and_would_pass_beside_the_body_is_given_way_to_again() -> None:
    crossing = impatient()
    crossing.give_way([comes(0.8, -0.6, 0.0, 0.15)], Pose2D(), DRIVES, WAIT_S_MAX + 0.2)  # 0.1 m from the centre
    assert crossing.patient


def test_a_slowed_robot_does_not_wait_however_long_it_is_slow() -> None:
    crossing = Crossing()
    for now in (0.0, WAIT_S_MAX, 2.0 * WAIT_S_MAX - 0.1):
        crossing.give_way(slow_is_enough(), Pose2D(), DRIVES, now)
    assert crossing.patient


def test_the_decision_names_the_closest_approach_of_the_conflict_until_it_has_ended() -> None:
    crossing = Crossing()
    crossing.give_way(slow_is_enough(), Pose2D(), DRIVES, 0.0)
    crossing.give_way([], Pose2D(), DRIVES, 0.5 * HOLD_S)
    assert crossing.decision is not None
    assert crossing.decision.condition == "it comes too near"


def test_a_more_careful_action_is_taken_at_once() -> None:
    crossing = Crossing()
    crossing.give_way(slow_is_enough(), Pose2D(), DRIVES, 0.0)
    assert action_of(crossing) is Action.SLOW
    crossing.give_way(head_on(), Pose2D(), DRIVES, 0.1 * HOLD_S)
    assert action_of(crossing) is Action.RIGHT


@pytest.mark.parametrize(("share", "action"), [(0.5, Action.RIGHT), (1.1, Action.SLOW)])
def test_a_less_careful_action_is_taken_after_the_hold(share: float, action: Action) -> None:
    crossing = Crossing()
    crossing.give_way(head_on(), Pose2D(), DRIVES, 0.0)
    crossing.give_way(slow_is_enough(), Pose2D(), DRIVES, share * HOLD_S)
    assert action_of(crossing) is action


@pytest.mark.parametrize("begins_at", [0.0, 1.0])
def test_a_bend_ends_at_the_heading_that_it_was_chosen_for(begins_at: float) -> None:
    """1.5 rad to the right, whatever the heading at its start."""
    crossing, turns = Crossing(), []
    crossing.give_way(head_on(Pose2D(0.0, 0.0, begins_at)), Pose2D(0.0, 0.0, begins_at), DRIVES, 0.0)
    for turned in (0.7, 1.4, 1.51, 1.6):
        there = Pose2D(0.0, 0.0, begins_at - turned)
        turns.append(crossing.give_way([], there, DRIVES, 0.1).angular_z < 0.0)
    assert turns == [True, True, False, False]


def test_a_robot_that_has_just_ended_its_bend_drives_straight_on() -> None:
    crossing = Crossing()
    crossing.give_way(head_on(), Pose2D(), DRIVES, 0.0)
    assert crossing.give_way([], Pose2D(0.0, 0.0, wrap(-1.5)), DRIVES, 0.1) == Twist(0.25, 0.0)


def test_a_bend_of_a_new_conflict_is_a_whole_one() -> None:
    crossing, turned = Crossing(), Pose2D(0.0, 0.0, -1.5)
    crossing.give_way(head_on(), Pose2D(), DRIVES, 0.0)
    crossing.give_way([], turned, DRIVES, 2.0 * HOLD_S)
    assert crossing.give_way(head_on(turned), turned, DRIVES, 3.0 * HOLD_S).angular_z < 0.0


def test_a_bend_that_what_stands_has_blocked_is_given_up_after_the_hold() -> None:
    crossing = Crossing()
    crossing.give_way(head_on(), Pose2D(), DRIVES, 0.0)
    assert crossing.give_way([comes(1.6, 0.0, -0.4, 0.0)], Pose2D(), DRIVES, 1.1 * HOLD_S, RING) == STILL
    assert action_of(crossing) is Action.WAIT


def test_a_bend_is_not_begun_beside_what_stands_in_its_way_or_close_to_it() -> None:
    """0.28 m along the bend to the right a point is nearer to the body than the clearance that an evasion keeps."""
    assert Crossing().give_way(head_on(), Pose2D(), DRIVES, 0.0).angular_z < 0.0
    assert Crossing().give_way(head_on(), Pose2D(), DRIVES, 0.0, [(0.4, -0.2)]).angular_z > 0.0


def test_the_fastest_of_several_decides_how_much_more_than_waiting_an_evasion_must_win() -> None:
    crossing, slower = Crossing(), comes(1.7, 0.9, -0.8, -0.3)
    crossing.give_way([comes(1.5, 1.6, -0.4, -1.0), slower], Pose2D(), DRIVES, 0.0)
    assert action_of(crossing) is Action.WAIT


def test_a_robot_that_has_slowed_down_compares_evasions_with_waiting() -> None:
    crossing = Crossing()
    crossing.give_way([comes(0.6, -1.9, 0.5, 0.4)], Pose2D(), DRIVES, 0.0)
    assert action_of(crossing) is Action.SLOW
    crossing.give_way([comes(2.3, 2.1, -0.5, -0.8)], Pose2D(), DRIVES, 1.1 * HOLD_S)
    assert action_of(crossing) is Action.WAIT


def test_what_is_near_and_goes_away_is_not_fled_from() -> None:
    """Another one makes the conflict, and is too far off to count as close."""
    crossing = Crossing()
    crossing.give_way([comes(0.6, 0.0, 0.2, -0.5), comes(0.7, 0.3, -0.6, 0.6)], Pose2D(), DRIVES, 0.0)
    assert action_of(crossing) is Action.WAIT


@pytest.mark.parametrize("pose", POSES)
def test_from_what_comes_close_and_crosses_a_robot_backs_off(pose: Pose2D) -> None:
    crossing = Crossing()
    crossing.give_way([comes(0.3, -0.5, 0.6, 0.9, pose)], pose, STILL, 0.0)
    assert action_of(crossing) is Action.BACK


def test_room_to_what_comes_close_is_compared_on_the_way_as_well_as_at_its_end() -> None:
    assert Crossing().give_way([comes(0.3, 0.3, -0.2, -0.4)], Pose2D(), DRIVES, 0.0) == Twist(-0.25, -0.9)


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("ahead", [1.0, -1.0])
def test_towards_what_goes_away_a_robot_drives_no_faster_than_it_goes(pose: Pose2D, ahead: float) -> None:
    goes = comes(0.9 * ahead, 0.3, 0.2 * ahead, 0.3, pose)
    twist = Crossing().give_way([goes], pose, Twist(0.4 * ahead, 0.0), 0.0)
    away_mps = (0.9 * 0.2 + 0.3 * 0.3) / hypot(0.9, 0.3)
    assert twist.linear_x * 0.9 / hypot(0.9, 0.3) == pytest.approx(away_mps * ahead)


@pytest.mark.parametrize("pose", POSES)
def test_towards_what_passes_aside_only_the_share_of_the_speed_that_leads_to_it_counts(pose: Pose2D) -> None:
    """At 0.9 m, in a direction whose cosine is 0.6: what it may come nearer and 0.1 m are left between the bodies."""
    twist = Crossing().give_way([comes(0.54, 0.72, 0.0, 0.25, pose)], pose, DRIVES, 0.0)
    room_m = 0.9 - RADIUS_M - 0.15 - 0.1 - WARY_S * 0.25
    assert twist.linear_x * 0.6 * WARY_S == pytest.approx(room_m)


def test_a_robot_is_not_slowed_for_what_comes_after_it() -> None:
    assert Crossing().give_way([comes(-3.0, 0.0, 0.6, 0.0)], Pose2D(), DRIVES, 0.0) == DRIVES


def test_a_slowed_robot_is_wary_as_well() -> None:
    crossing = Crossing(cruise_mps=0.5)
    twist = crossing.give_way([comes(0.7, -0.1, 0.3, 1.0)], Pose2D(), DRIVES, 0.0)
    assert action_of(crossing) is Action.SLOW
    assert 0.0 < twist.linear_x < 0.4 * 0.5


def test_a_bend_out_of_the_way_is_not_slowed_for_what_comes_on() -> None:
    assert Crossing().give_way([comes(1.2, 0.0, -0.6, 0.0)], Pose2D(), DRIVES, 0.0) == Twist(0.45, -0.9)
