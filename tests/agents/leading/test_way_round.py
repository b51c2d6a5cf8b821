"""A way round is planned where a detour wins nothing; it ends back on the route, at the first place that is free."""

from __future__ import annotations

from math import inf, pi

import pytest

from lfa.agents.avoidance.decision import Action, Decision
from lfa.agents.leading.path_follower import PathFollower
from lfa.agents.leading.way_round import BACK_S, PATIENCE_S, WayRound
from lfa.agents.perception.obstacle import Class
from lfa.protocol.geometry import STILL, Pose2D
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import LaserScan
from lfa.protocol.mission import Leading, Limits, Mission

ROUTE = ((0.0, 0.0), (20.0, 0.0))


def started(*route: tuple[float, float]) -> tuple[WayRound, PathFollower]:
    leading = Leading(route_m=route or ROUTE)
    lead = PathFollower(leading, Limits())
    lead.begin(Pose2D())
    return WayRound(Mission(robots=(1,), leading=leading), lead), lead


def detour(action: Action, kind: Class = "wall") -> Decision:
    return Decision(action, inf, 0.0, kind)


@pytest.mark.parametrize(
    ("action", "after_s"),
    [(Action.LEFT, PATIENCE_S), (Action.U_TURN, PATIENCE_S), (Action.BACK, BACK_S)],
)
def test_a_detour_that_wins_nothing_begins_a_way_round(action: Action, after_s: float) -> None:
    rounding, _ = started()
    rounding.watch(detour(action), 0.0)
    rounding.watch(detour(action), after_s - 0.1)
    assert rounding.way is None
    rounding.watch(detour(action), after_s + 0.1)
    assert rounding.way is not None


@pytest.mark.parametrize("alone", [True, False])
def test_blocked_on_all_sides_a_robot_alone_plans_and_one_with_followers_hands_over(alone: bool) -> None:
    rounding, _ = started()
    rounding.watch(detour(Action.BLOCKED), 0.0, alone=alone)
    rounding.watch(detour(Action.BLOCKED), BACK_S + 0.1, alone=alone)
    assert (rounding.way is not None) == alone


def test_a_detour_that_wins_its_way_goes_on_alone() -> None:
    rounding, lead = started()
    for n in range(40):
        lead.track(Pose2D(0.25 * n, 0.4, 0.0))
        rounding.watch(detour(Action.LEFT), 0.5 * n)
    assert rounding.way is None


def test_two_short_detours_are_not_one_long_one() -> None:
    rounding, _ = started()
    rounding.watch(detour(Action.LEFT), 0.0)
    rounding.watch(None, 0.6 * PATIENCE_S)
    rounding.watch(detour(Action.LEFT), 0.7 * PATIENCE_S)
    rounding.watch(detour(Action.LEFT), 1.2 * PATIENCE_S)
    assert rounding.way is None


def test_what_the_scanner_does_not_show_is_left_to_the_detour() -> None:
    rounding, _ = started()
    for n in range(20):
        rounding.watch(detour(Action.LEFT, "ditch"), float(n))
    assert rounding.way is None


def test_back_on_the_route_the_leader_goes_on_from_there() -> None:
    rounding, lead = started()
    rounding.watch(detour(Action.BACK), 0.0)
    rounding.watch(detour(Action.BACK), BACK_S)
    assert rounding.steer([], Pose2D(), STILL, [], 0.5, BACK_S + 1.0) == STILL, "no route is planned yet"
    assert rounding.steer([], Pose2D(1.5, 0.0, 0.0), STILL, [], 0.5, BACK_S + 1.1) is None
    assert rounding.way is None
    assert lead.place_m == pytest.approx(1.5, abs=0.1)


def test_a_way_point_that_can_be_passed_is_not_passed_over() -> None:
    rounding, lead = started((0.0, 0.0), (1.0, 0.0), (20.0, 0.0))
    rounding.watch(detour(Action.BACK), 0.0)
    rounding.watch(detour(Action.BACK), BACK_S)
    rounding.steer([], Pose2D(), STILL, [], 0.5, BACK_S + 1.0)
    assert rounding.steer([], Pose2D(1.0, 0.0, 0.0), STILL, [], 0.5, BACK_S + 1.1) is None
    assert lead.place_m == pytest.approx(1.0, abs=0.1)


def test_a_place_to_return_to_that_turns_out_occupied_is_given_up_for_one_farther_on() -> None:
    """It was chosen on ground that nobody had seen: back there, the robot would stand before the next thing."""
    rounding, _ = started()
    rounding.watch(detour(Action.BACK), 0.0)
    rounding.watch(detour(Action.BACK), BACK_S)
    way = rounding.way
    assert way is not None
    rounding.steer([], Pose2D(), STILL, [], 0.5, BACK_S + 1.0)
    chosen = way.lead.place
    assert chosen is not None
    ranges = tuple(1.8 if abs(n - 90) < 10 else 10.0 for n in range(180))
    scan = LaserScan(Header("robot1", 1, 1, 0.0), -pi, 2.0 * pi / 180, 0.05, 10.0, ranges)
    for n in range(20):
        way.explore.see(scan, Pose2D(), STILL, [])
        way.work(True, Pose2D(), [], BACK_S + 1.0 + 0.02 * n)
    assert rounding.steer([], Pose2D(), STILL, [], 0.5, BACK_S + 1.5) is not None
    assert way.lead.place is not None
    assert way.lead.place[0] > chosen[0] + 0.5


def test_a_way_round_that_is_not_found_wins_no_progress() -> None:
    """Walled in on all sides: the detour has the robot again, where it was on its route."""
    rounding, lead = started()
    rounding.watch(detour(Action.BACK), 0.0)
    rounding.watch(detour(Action.BACK), BACK_S)
    way = rounding.way
    assert way is not None
    scan = LaserScan(Header("robot1", 1, 1, 0.0), -pi, 2.0 * pi / 180, 0.05, 10.0, (0.6,) * 180)
    for n in range(2000):
        now = BACK_S + 0.02 * n
        way.explore.see(scan, Pose2D(), STILL, [])
        way.work(True, Pose2D(), [], now)
        if rounding.steer([], Pose2D(), STILL, [], 0.5, now) is None:
            break
    assert rounding.way is None
    assert lead.place_m == pytest.approx(0.0, abs=0.1)
