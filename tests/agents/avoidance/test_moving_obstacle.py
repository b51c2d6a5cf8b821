"""What moves across the way is given way to, for a bounded time."""

import pytest

from lfa.agents.avoidance.decision import Action
from lfa.agents.avoidance.moving_obstacle import HOLD_S, SLOW_SHARE, WAIT_S_MAX, Crossing
from lfa.agents.avoidance.moving_points import before, shadow
from lfa.agents.perception.obstacle_tracker import Feature
from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc
from lfa.protocol.mission import Limits

AHEAD = Twist(0.5, 0.0)


def crosser(x: float, y: float, vx: float, vy: float) -> list[Feature]:
    return [Feature("moving", x, y, 0.25, vx, vy)]


def test_what_passes_far_off_changes_nothing() -> None:
    crossing = Crossing()
    assert crossing.give_way(crosser(1.0, 3.0, 0.3, 0.0), Pose2D(), AHEAD, 0.0) == AHEAD
    assert crossing.decision is None


def test_what_moves_away_is_no_conflict() -> None:
    assert Crossing().give_way(crosser(0.7, 0.0, 0.8, 0.0), Pose2D(), AHEAD, 0.0) == AHEAD


def test_what_crosses_is_let_pass() -> None:
    crossing = Crossing()
    twist = crossing.give_way(crosser(1.2, -0.8, 0.0, 0.3), Pose2D(), AHEAD, 0.0)
    assert twist.linear_x < AHEAD.linear_x
    assert crossing.decision is not None
    assert crossing.decision.kind == "moving"


def test_the_robot_stays_slow_for_a_while_after_the_conflict() -> None:
    crossing = Crossing()
    crossing.give_way(crosser(1.2, -0.8, 0.0, 0.3), Pose2D(), AHEAD, 0.0)
    assert crossing.give_way([], Pose2D(), AHEAD, 0.5 * HOLD_S).linear_x < AHEAD.linear_x
    assert crossing.give_way([], Pose2D(), AHEAD, 1.1 * HOLD_S) == AHEAD


def test_a_slowed_robot_drives_a_share_of_the_cruise_speed_and_does_not_crawl() -> None:
    """What it wants grows from its last speed by its acceleration: a share of that would be taken again and again."""
    crossing, last = Crossing(cruise_mps=0.5), AHEAD
    for n in range(100):
        wanted = Twist(min(0.5, last.linear_x + 0.5 * 0.02), 0.0)
        last = crossing.give_way(crosser(2.0, -1.3, 0.0, 0.25), Pose2D(), wanted, 0.02 * n)
    assert crossing.decision is not None
    assert crossing.decision.action is Action.SLOW
    assert last.linear_x == pytest.approx(SLOW_SHARE * 0.5)


def test_what_comes_straight_at_a_robot_is_not_met() -> None:
    """Head-on, at up to the robot's own speed, whether it drives or stands: it steps aside, and is not driven back."""
    for speed in (0.2, 0.3, 0.5):
        for wanted in (AHEAD, STILL):
            crossing, pose, x, least = Crossing(), Pose2D(), 4.0, 9.0
            for n in range(900):
                twist = crossing.give_way(crosser(x, 0.0, -speed, 0.0), pose, wanted, 0.02 * n)
                pose = along_arc(pose, twist, 0.02)
                x -= speed * 0.02
                least = min(least, ((x - pose.x) ** 2 + pose.y**2) ** 0.5 - 0.25 - 0.15)
            assert least > 0.1, f"{speed} m/s, {wanted}: {least:.2f} m"


def test_after_the_longest_wait_the_robot_goes_on() -> None:
    crossing = Crossing()
    now = 0.0
    while now <= WAIT_S_MAX:
        crossing.give_way(crosser(1.5, -0.9, 0.0, 0.15), Pose2D(), AHEAD, now)
        now += 0.02
    assert crossing.give_way(crosser(1.5, -0.9, 0.0, 0.15), Pose2D(), AHEAD, now) == AHEAD


def test_what_was_waited_for_and_comes_on_is_given_way_to_again() -> None:
    crossing = Crossing()
    for n in range(300):
        crossing.give_way(crosser(1.5, -0.9, 0.0, 0.15), Pose2D(), AHEAD, 0.02 * n)
    assert not crossing.patient
    assert crossing.give_way(crosser(0.8, -0.3, 0.0, 0.15), Pose2D(), AHEAD, 6.02).linear_x < AHEAD.linear_x
    assert crossing.patient


def test_what_moves_slowly_has_a_shadow_ahead_of_it_and_none_behind() -> None:
    points = shadow(crosser(2.0, 0.0, 0.0, -0.1), Pose2D())
    assert min(y for _, y in points) == pytest.approx(-0.8 - 0.25)
    assert max(y for _, y in points) < 0.0
    assert shadow(crosser(2.0, 0.0, 0.0, -0.4), Pose2D()) == [], "what is fast has passed by then"


def test_no_slower_crosser_is_touched_whenever_it_comes() -> None:
    """A robot on a straight way and one obstacle across it at 0.3 m/s, at many phases."""
    for phase in range(20):
        crossing, pose, y, least = Crossing(), Pose2D(), -2.0 - 0.1 * phase, 9.0
        for n in range(600):
            twist = crossing.give_way(crosser(2.0, y, 0.0, 0.3), pose, AHEAD, 0.02 * n)
            pose = along_arc(pose, twist, 0.02)
            y += 0.3 * 0.02
            least = min(least, ((2.0 - pose.x) ** 2 + (y - pose.y) ** 2) ** 0.5 - 0.25 - 0.15)
        assert least > 0.0, f"touched at phase {phase}"


def test_who_stands_before_what_comes_from_behind_goes_ahead_out_of_its_way() -> None:
    """What turned round behind a robot and comes on at walking pace: to wait or to back off is to be touched."""
    crossing, pose, y, least = Crossing(), Pose2D(0.0, 0.0, -1.27), 1.2, 9.0
    for n in range(400):
        twist = crossing.give_way(crosser(0.2, y, 0.0, -0.22), pose, Twist(0.1, 0.0), 0.02 * n)
        pose = along_arc(pose, twist, 0.02)
        y -= 0.22 * 0.02
        least = min(least, ((0.2 - pose.x) ** 2 + (y - pose.y) ** 2) ** 0.5 - 0.25 - 0.15)
    assert least > 0.2, least


def test_who_made_room_to_a_side_and_is_followed_turns_farther_to_that_side() -> None:
    """What came head-on and turns after the robot: the bend that was chosen first is driven, and another one begins."""
    crossing, pose, x, y, least = Crossing(), Pose2D(), 2.0, 0.0, 9.0
    for n in range(400):
        away = ((pose.x - x) ** 2 + (pose.y - y) ** 2) ** 0.5
        vx, vy = 0.35 * (pose.x - x) / away, 0.35 * (pose.y - y) / away
        twist = crossing.give_way(crosser(x, y, vx, vy), pose, STILL, 0.02 * n)
        pose = along_arc(pose, twist, 0.02)
        x, y = x + 0.02 * vx, y + 0.02 * vy
        least = min(least, away - 0.25 - 0.15)
    assert least > 0.1, least


def test_what_comes_from_the_side_does_not_stop_a_robot_in_its_way() -> None:
    aside, ahead = crosser(0.05, -0.6, 0.0, 0.4), crosser(0.8, 0.1, -0.4, 0.0)
    assert before(aside, Pose2D(), 0.5, 0.3) == []
    assert len(before(ahead, Pose2D(), 0.5, 0.3)) == 1
    assert before(ahead, Pose2D(), 0.5, -0.3) == [], "it drives away from it"
    assert len(before([*aside, *ahead], Pose2D(), 0.5, 0.0)) == 2


def test_room_is_not_made_towards_a_team_mate_that_makes_room_as_well() -> None:
    """Two of a team before what comes head-on: without the other one it goes to the right."""
    mate = [Feature("moving", 0.3, -0.8, 0.0, 0.0, 0.2)]
    alone, beside = Crossing(), Crossing()
    assert alone.give_way(crosser(1.6, 0.0, -0.4, 0.0), Pose2D(), AHEAD, 0.0).angular_z < 0.0
    twist = beside.give_way(crosser(1.6, 0.0, -0.4, 0.0), Pose2D(), AHEAD, 0.0, mates=lambda *_: mate)
    assert twist.angular_z > 0.0


@pytest.mark.parametrize(("x", "backs"), [(0.65, True), (-0.65, False)])
def test_from_what_comes_close_a_robot_drives_away_whatever_way_it_means_to_pass_by(x: float, backs: bool) -> None:
    """It would pass by at some distance; it may turn, and then a robot that waits is touched."""
    passes_by = crosser(x, 0.2, -0.4 if backs else 0.4, 0.25)
    twist = Crossing().give_way(passes_by, Pose2D(), STILL, 0.0)
    assert (twist.linear_x < 0.0) is backs
    assert twist.linear_x != 0.0


def test_a_robot_slows_down_towards_what_passes_near_for_it_may_turn() -> None:
    """It goes by ahead, and will not have met the robot; the nearer it is, the slower the robot drives towards it."""
    speeds = [Crossing().give_way(crosser(x, 0.3, 0.2, 0.3), Pose2D(), AHEAD, 0.0).linear_x for x in (0.9, 1.1, 2.0)]
    assert speeds[0] < speeds[1] < AHEAD.linear_x
    assert speeds[2] == AHEAD.linear_x


def test_what_is_faster_than_an_evasion_is_escaped_from_at_a_higher_speed() -> None:
    """It comes on from behind at 0.6 m/s, and turns after the robot: ahead at 0.25 m/s it would reach it."""
    twist = Crossing().give_way(crosser(-0.65, 0.0, 0.6, 0.0), Pose2D(), STILL, 0.0)
    assert twist.linear_x > 0.6


def test_a_robot_at_speed_turns_away_from_what_comes_close_while_it_rolls_on() -> None:
    """What comes by on its left: from rest it backs off with its tail away from it, at speed its nose goes first."""
    comes = crosser(0.6, 0.4, -0.4, 0.0)
    from_rest = Crossing(limits=Limits(a_max_mps2=0.5)).give_way(comes, Pose2D(), STILL, 0.0)
    at_speed = Crossing(limits=Limits(a_max_mps2=0.5)).give_way(comes, Pose2D(), STILL, 0.0, last=Twist(0.6, 0.0))
    assert at_speed.angular_z < 0.0 < from_rest.angular_z


def test_what_comes_fast_is_passed_on_one_side_although_its_direction_is_not_certain() -> None:
    """At 1.5 m/s from 4 m an estimate that is off by a few degrees points now to the left, now to the right of it."""
    crossing, pose, x, turns = Crossing(), Pose2D(), 4.0, set()
    for n in range(80):
        aside = 0.12 if n // 10 % 2 else -0.12
        twist = crossing.give_way(crosser(x, 0.0, -1.5, aside), pose, AHEAD, 0.02 * n)
        pose = along_arc(pose, twist, 0.02)
        x -= 1.5 * 0.02
        turns.add(None if crossing.decision is None else crossing.decision.action)
    assert len(turns & {Action.LEFT, Action.RIGHT}) == 1, turns


def test_evasions_are_compared_as_the_drive_can_do_them() -> None:
    """It comes on from behind, to the left: a robot of 0.2 m/s cannot drive on in time, and turns off to the right."""
    comes = crosser(-0.65, 0.1, 0.4, 0.0)
    fast, slow = Crossing(), Crossing(limits=Limits(v_max_mps=0.2))
    assert fast.give_way(comes, Pose2D(), STILL, 0.0).angular_z == 0.0
    twist = slow.give_way(comes, Pose2D(), STILL, 0.0)
    assert twist.angular_z < 0.0
    assert twist.linear_x <= 0.2
