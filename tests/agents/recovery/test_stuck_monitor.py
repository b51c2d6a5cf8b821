"""How long a robot counts as stuck, where, and what ends it: its pose, its role, its rest."""

from collections.abc import Callable

import pytest

from lfa.agents.avoidance.decision import Action
from lfa.agents.recovery.stuck_detector import (
    CALM_S,
    CELL_ENTRIES,
    COMES_BACK,
    FREED_M,
    STANDS_S,
    STILL_S,
    StuckMonitor,
)
from lfa.protocol.geometry import STILL, Pose2D, Twist

AHEAD = Twist(0.4, 0.0)


def stood(seconds: float, *, leads: bool, speed_mps: float = 0.0) -> str | None:
    """The state of one that wants next to nothing, and says no other reason."""
    stuck = StuckMonitor()
    for n in range(round(seconds / 0.02)):
        stuck.watch(Pose2D(speed_mps * 0.02 * n, 0.0, 0.0), STILL, Action.LEFT, None, 0.02 * n, leads=leads)
    return stuck.reason


def test_S1_a_leader_that_is_to_go_stands_for_20_s_whatever_for() -> None:
    assert STANDS_S == 20.0
    assert str(stood(20.2, leads=True)).startswith("S1")
    assert stood(19.0, leads=True) is None
    assert stood(60.0, leads=True, speed_mps=0.02) is None


def test_a_follower_stands_as_long_as_its_slot_does() -> None:
    assert stood(60.0, leads=False) is None


def test_S6_own_pose_lost_until_it_is_found() -> None:
    monitor = StuckMonitor()
    monitor.lose_pose("odometry")
    assert monitor.reason == "S6: own pose lost, no odometry"
    assert monitor.pose_lost
    monitor.find_pose()
    assert monitor.reason is None


def while_stuck() -> StuckMonitor:
    stuck = StuckMonitor()
    for n in range(150):
        stuck.watch(Pose2D(), STILL, Action.BLOCKED, None, 0.02 * n, leads=False)
    assert stuck.reason is not None
    return stuck


def test_who_is_stuck_is_so_until_it_is_half_a_metre_away() -> None:
    stuck = while_stuck()
    stuck.watch(Pose2D(0.8 * FREED_M, 0.0, 0.0), STILL, None, None, 3.1, leads=False)
    assert stuck.reason is not None
    stuck.watch(Pose2D(FREED_M, 0.0, 0.0), STILL, None, None, 3.2, leads=False)
    assert stuck.reason is None


def test_or_until_nothing_has_held_it_for_a_while() -> None:
    stuck = while_stuck()
    stuck.rest(Pose2D(), 2.9 + CALM_S)
    assert stuck.reason is not None
    stuck.rest(Pose2D(), 3.1 + CALM_S)
    assert stuck.reason is None


def test_a_stuck_leader_is_stuck_as_a_follower_and_a_new_leader_begins_anew() -> None:
    stuck = while_stuck()
    stuck.begin(leading=False)
    assert stuck.reason is not None
    stuck.begin(leading=True)
    assert stuck.reason is None


def test_a_robot_that_rests_is_watched_anew() -> None:
    monitor = StuckMonitor()
    for begin_s in (0.0, 3.0):  # twice almost long enough, with a rest between
        for n in range(round((STILL_S - 0.2) / 0.02)):
            monitor.watch(Pose2D(), AHEAD, None, None, begin_s + 0.02 * n, leads=False)
        monitor.rest(Pose2D(), begin_s + STILL_S - 0.1)
    assert monitor.reason is None


def test_a_new_role_is_watched_anew() -> None:
    monitor = StuckMonitor()
    for n in range(round((STILL_S - 0.2) / 0.02)):
        monitor.watch(Pose2D(), AHEAD, None, None, 0.02 * n, leads=False)
    monitor.begin(leading=False)
    monitor.watch(Pose2D(), AHEAD, None, None, STILL_S, leads=False)
    assert monitor.reason is None


def test_the_place_is_where_a_robot_got_stuck_first() -> None:
    monitor = StuckMonitor()
    for now, x in ((0.0, 0.0), (2.0, 0.0), (2.1, 0.8 * FREED_M)):
        monitor.watch(Pose2D(x, 0.0, 0.0), STILL, Action.BLOCKED, None, now, leads=False)
    assert monitor.reason is not None
    monitor.rest(Pose2D(FREED_M, 0.0, 0.0), 2.2)
    assert monitor.reason is None


def test_who_is_stuck_beside_the_axis_is_not_free_where_it_stands() -> None:
    monitor = StuckMonitor()
    for now in (0.0, 2.0):
        monitor.watch(Pose2D(0.0, 3.0, 0.0), STILL, Action.BLOCKED, None, now, leads=False)
    monitor.rest(Pose2D(0.0, 3.0, 0.0), 2.1)
    assert monitor.reason is not None
    monitor.rest(Pose2D(0.0, 3.0 - FREED_M, 0.0), 2.2)
    assert monitor.reason is None
    for now in (10.0, 12.0):
        monitor.watch(Pose2D(3.0, 0.0, 0.0), STILL, Action.BLOCKED, None, now, leads=False)
    monitor.rest(Pose2D(3.0, 0.0, 0.0), 12.1)
    assert monitor.reason is not None


def test_a_robot_that_finds_its_pose_again_is_watched_anew() -> None:
    monitor = StuckMonitor()
    for n in range(round((STILL_S - 0.2) / 0.02)):
        monitor.watch(Pose2D(), AHEAD, None, None, 0.02 * n, leads=False)
    monitor.lose_pose("localization")
    assert monitor.pose_lost
    monitor.find_pose()
    monitor.watch(Pose2D(), AHEAD, None, None, STILL_S, leads=False)
    assert monitor.reason is None


def come_back(*, again: bool = True, moving: bool = False) -> StuckMonitor:
    """A monitor of a robot that was in one place again and again."""
    monitor = StuckMonitor()
    for n in range(CELL_ENTRIES):
        for x, now in ((1.1, 4.0 * n), (0.1, 4.0 * n + 2.0)):
            here = Pose2D(x, 0.1, 0.0)
            monitor.watch(here, AHEAD, Action.LEFT, None, now, leads=False, again=again, moving=moving)
    return monitor


def test_S3_a_robot_that_comes_back_after_it_gave_way_to_what_moves_is_in_no_trap() -> None:
    assert come_back(moving=True).reason is None


def test_S3_on_a_planned_way_coming_back_does_not_count_and_all_else_does() -> None:
    assert come_back(again=True).reason == COMES_BACK
    monitor = come_back(again=False)
    assert monitor.reason is None
    for now in (20.0, 22.0):
        monitor.watch(Pose2D(), STILL, Action.BLOCKED, None, now, leads=False, again=False)
    assert str(monitor.reason).startswith("S2")


def other_role(monitor: StuckMonitor) -> None:
    monitor.begin(leading=True)


def follows_for_a_step(monitor: StuckMonitor) -> None:
    monitor.watch(Pose2D(), STILL, None, None, STANDS_S - 1.9, leads=False)


def without_pose_for_a_step(monitor: StuckMonitor) -> None:
    monitor.lose_pose("localization")
    monitor.find_pose()


def rests_for_a_step(monitor: StuckMonitor) -> None:
    monitor.rest(Pose2D(), STANDS_S - 1.9)


@pytest.mark.parametrize("between", [other_role, follows_for_a_step, without_pose_for_a_step, rests_for_a_step])
def test_S1_a_leader_stands_from_when_it_began_to(between: Callable[[StuckMonitor], None]) -> None:
    monitor = StuckMonitor()
    for now in (0.0, STANDS_S - 2.0):
        monitor.watch(Pose2D(), STILL, None, None, now, leads=True)
    between(monitor)
    for now in (STANDS_S - 1.8, STANDS_S + 1.0):
        monitor.watch(Pose2D(), STILL, None, None, now, leads=True)
    assert monitor.reason is None


def test_who_is_stuck_for_another_reason_has_its_pose() -> None:
    assert not while_stuck().pose_lost


def test_who_is_blocked_when_its_pose_comes_back_is_stuck_where_it_is_then() -> None:
    monitor = StuckMonitor()
    monitor.lose_pose("localization")
    for now in (0.0, 2.0):
        monitor.watch(Pose2D(), STILL, Action.BLOCKED, None, now, leads=False)
    assert str(monitor.reason).startswith("S2")
    monitor.rest(Pose2D(FREED_M, 0.0, 0.0), 2.1)
    assert monitor.reason is None


def test_who_is_out_of_the_place_backs_out_no_more_and_is_watched_anew() -> None:
    monitor = StuckMonitor()
    for n in range(round((STILL_S + 0.2) / 0.02)):
        monitor.watch(Pose2D(), AHEAD, None, None, 0.02 * n, leads=False)
    assert monitor.reason is not None
    monitor.backing_out = True
    monitor.out()
    assert not monitor.backing_out
    monitor.watch(Pose2D(), AHEAD, None, None, STILL_S + 0.22, leads=False)
    assert monitor.reason is None


@pytest.mark.parametrize("planned_s", [1.5, 30.0])
def test_S1_the_time_in_which_a_leader_plans_its_way_neither_counts_nor_ends_its_stand(planned_s: float) -> None:
    """One whose ways all began with what its body touches planned the next one each three seconds, for ever."""
    stuck, now, stood_s = StuckMonitor(), 0.0, 0.0
    while stuck.reason is None and stood_s < 2.0 * STANDS_S:
        plans = now % (1.5 + planned_s) >= 1.5
        now, stood_s = now + 0.02, stood_s + (0.0 if plans else 0.02)
        stuck.watch(Pose2D(), STILL, Action.PLAN_ROUND, None, now, leads=not plans, plans=plans)
    assert str(stuck.reason).startswith("S1")
    assert stood_s == pytest.approx(STANDS_S, abs=0.5)
