"""What turns again and again is gone round and not waited for; what comes close is fled from all the same."""

from __future__ import annotations

from math import atan2, cos, hypot, inf, pi, sin
from random import Random

import pytest
from msgspec.structs import replace

from lfa.agents.avoidance.decision import Action
from lfa.agents.avoidance.moving_obstacle import CALM_S, HOLD_S, WAIT_S_MAX, Crossing
from lfa.agents.perception.obstacle_tracker import Feature
from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc

DRIVES = Twist(0.4, 0.0)
RADIUS_M = 0.2


def restless(x: float, y: float, vx: float, vy: float) -> Feature:
    return Feature("moving", x, y, RADIUS_M, vx, vy, keeps_s=1.0)


def action_of(crossing: Crossing) -> Action | None:
    return None if crossing.decision is None else crossing.decision.action


def test_what_turns_again_and_again_is_not_waited_for() -> None:
    """If it went on as it does it would cross the way 0.3 m ahead of the robot: what does so is waited for."""
    crosses = restless(1.5, -0.9, 0.0, 0.25)
    assert Crossing().give_way([crosses], Pose2D(), DRIVES, 0.0) == DRIVES
    assert Crossing().give_way([replace(crosses, keeps_s=4.0 * HOLD_S)], Pose2D(), DRIVES, 0.0) == DRIVES
    waits = Crossing()
    waits.give_way([replace(crosses, keeps_s=inf)], Pose2D(), DRIVES, 0.0)
    assert waits.decision is not None


def test_what_turns_again_and_again_and_would_touch_soon_is_given_way_to() -> None:
    crossing = Crossing()
    crossing.give_way([restless(1.2, 0.0, -0.3, 0.0)], Pose2D(), DRIVES, 0.0)
    assert crossing.decision is not None


def test_from_what_turns_again_and_again_a_robot_keeps_away_although_it_would_pass() -> None:
    """At 0.2 m it may turn: a robot that stands there is touched."""
    crossing = Crossing()
    twist = crossing.give_way([restless(0.55, 0.0, 0.0, -0.4)], Pose2D(), STILL, 0.0)
    assert twist.linear_x < 0.0


def test_out_of_the_way_of_one_a_robot_does_not_drive_into_another_that_may_turn() -> None:
    crossing, comes = Crossing(), restless(-0.45, 0.35, 0.3, -0.2)
    flees = crossing.give_way([comes], Pose2D(), DRIVES, 0.0)
    assert flees.linear_x > DRIVES.linear_x
    slows = crossing.give_way([comes, restless(0.75, -0.2, 0.0, 0.3)], Pose2D(), DRIVES, 0.1)
    assert slows.linear_x < 0.5 * DRIVES.linear_x


def test_who_flees_from_one_that_is_close_keeps_room_to_the_others() -> None:
    """Alone it would be fled from to the right, where another one comes."""
    near, comes = restless(-0.45, 0.35, 0.3, -0.2), restless(1.0, -0.7, -0.2, 0.2)
    alone = Crossing().give_way([near], Pose2D(), DRIVES, 0.0, last=DRIVES)
    both = Crossing().give_way([near, comes], Pose2D(), DRIVES, 0.0, last=DRIVES)
    assert alone.angular_z < 0.0 < both.angular_z


@pytest.mark.parametrize("seed", range(6))
def test_a_robot_at_rest_where_one_walks_about_is_not_touched(seed: int) -> None:
    """It takes another direction each second, at 0.4 m/s, and turns back 1.2 m from its middle."""
    chance, crossing, pose, twist, least = Random(seed), Crossing(), Pose2D(), STILL, 9.0
    x, y, vx, vy = 0.9, 0.0, 0.0, 0.0
    for n in range(600):
        if n % 10 == 0:
            angle = chance.uniform(-pi, pi) if hypot(x - 0.9, y) < 0.8 else atan2(-y, 0.9 - x)
            vx, vy = 0.4 * cos(angle), 0.4 * sin(angle)
        twist = crossing.give_way([restless(x, y, vx, vy)], pose, STILL, 0.1 * n, last=twist)
        pose, x, y = along_arc(pose, twist, 0.1), x + 0.1 * vx, y + 0.1 * vy
        least = min(least, hypot(x - pose.x, y - pose.y) - RADIUS_M - 0.15)
    assert least > 0.0, least


def waits_again_and_again(calm_s: float) -> Crossing:
    """Return the behaviour of a robot that waits for what creeps across its way, at rest meets nothing for `calm_s`
    [s], and then drives on.
    """
    crossing, now = Crossing(), 0.0
    creeps = [Feature("moving", 1.5, -0.9, 0.25, 0.0, 0.15)]
    while now < 2.0 * WAIT_S_MAX:
        crossing.give_way(creeps, Pose2D(), DRIVES, now)
        for resting_s in (HOLD_S, HOLD_S + 0.5 * calm_s, HOLD_S + calm_s):
            crossing.give_way(creeps, Pose2D(), STILL, now + resting_s)
        now += HOLD_S + calm_s + 0.02
    return crossing


def test_a_robot_that_waits_again_and_again_for_the_same_thing_passes_it() -> None:
    assert not waits_again_and_again(0.2).patient


def test_a_robot_that_has_met_nothing_for_a_while_waits_anew() -> None:
    assert waits_again_and_again(CALM_S).patient


def test_a_robot_keeps_the_side_of_its_bend_for_a_while_although_what_comes_seems_to_turn() -> None:
    """An estimate of its direction that errs to and fro moved it from one side to the other, and it met the robot."""
    crossing = Crossing()

    def comes(aside_mps: float) -> list[Feature]:
        return [Feature("moving", 3.0, 0.0, 0.25, -1.0, aside_mps)]

    assert crossing.give_way(comes(0.1), Pose2D(), DRIVES, 0.0).angular_z < 0.0
    assert crossing.give_way(comes(-0.15), Pose2D(), DRIVES, 0.5 * HOLD_S).angular_z < 0.0
    assert crossing.give_way(comes(-0.15), Pose2D(), DRIVES, 1.1 * HOLD_S).angular_z > 0.0
