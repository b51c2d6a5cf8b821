"""E32 at one robot: which change of the mission holds, and from whom."""

from __future__ import annotations

from msgspec import structs

from lfa.agents.orders.team_orders import REMIND_S, TeamOrders
from lfa.protocol.messages.consensus import NO_TERM, Term
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.orders import OrderNote, TeamOrder
from lfa.protocol.messages.team import Event
from lfa.protocol.mission import Leading, Mission
from lfa.protocol.outbox import Outbox

MISSION = Mission(robots=(1, 2, 3), leading=Leading(route_m=((5.0, 0.0),)))
OLD, NEW = Term(3, 1, 1), Term(4, 2, 1)


class Robot:
    """The orders at one robot, and what it publishes."""

    def __init__(self) -> None:
        self._outbox = Outbox("f", "robot1", 1)
        self.orders = TeamOrders(self._outbox, MISSION)

    def told(self) -> list[tuple[int, Term | None]]:
        said = [envelope.message for envelope in self._outbox.drain()]
        return [(message.order.version, message.term) for message in said if isinstance(message, OrderNote)]

    def events(self) -> list[tuple[str, int]]:
        said = [envelope.message for envelope in self._outbox.drain()]
        return [(message.kind, message.data["version"]) for message in said if isinstance(message, Event)]


def to(x: float, version: int) -> TeamOrder:
    return TeamOrder(structs.replace(MISSION.leading, route_m=((x, 0.0),)), MISSION.formation, version, version)


def carried(order: TeamOrder, term: Term) -> OrderNote:
    return OrderNote(Header("robot2", 1, 1, 0.0), order, term)


def test_e32_a_leader_carries_an_order_out_once_and_acknowledges_it_again() -> None:
    robot = Robot()
    assert robot.orders.propose(to(7.0, 1), True, OLD, 0.0)
    assert not robot.orders.propose(to(7.0, 1), True, OLD, 0.1)
    assert robot.events() == [("order", 1), ("order", 1)]
    assert robot.orders.mission.goal_m == (7.0, 0.0)


def test_e32_late_and_replayed_orders_are_refused() -> None:
    robot = Robot()
    robot.orders.propose(to(7.0, 2), True, OLD, 0.0)
    assert not robot.orders.propose(to(8.0, 1), True, OLD, 0.1)
    assert not robot.orders.propose(to(9.0, 2), True, OLD, 0.1), "another operator was quicker"
    assert robot.events() == [("order", 2), ("order_refused", 1), ("order_refused", 2)]
    assert robot.orders.mission.goal_m == (7.0, 0.0)


def test_e32_a_made_up_version_is_not_the_last() -> None:
    for leads in (True, False):
        robot = Robot()
        assert not robot.orders.propose(to(9.0, 2**53), leads, OLD, 0.0)
        assert not robot.orders.hear(carried(to(9.0, 2**53), OLD), OLD, 0.1)
        assert not leads or not robot.orders.hear_robot(carried(to(9.0, 2**53), OLD), OLD, 0.2)
        assert not robot.orders.begin(NEW, 0.3)
        assert robot.orders.propose(to(7.0, 1), True, NEW, 0.4)


def test_e32_an_order_that_the_mission_does_not_allow_changes_nothing() -> None:
    robot = Robot()
    hasty = TeamOrder(structs.replace(MISSION.leading, cruise_mps=9.0), MISSION.formation, 1)
    assert not robot.orders.propose(hasty, True, OLD, 0.0)
    assert robot.events() == [("order_refused", 1)]
    assert robot.orders.mission == MISSION


def test_e32_a_new_leader_goes_on_with_the_newest_order_whoever_it_came_from() -> None:
    robot = Robot()
    assert not robot.orders.propose(to(7.0, 1), False, OLD, 0.0), "it does not lead yet"
    assert robot.orders.hear(carried(to(6.0, 0), OLD), OLD, 0.1) is False
    assert robot.orders.begin(NEW, 0.2)
    assert robot.orders.mission.goal_m == (7.0, 0.0)
    assert robot.events() == [("order", 1)]


def test_e32_a_new_leader_does_not_return_to_an_order_that_a_later_one_has_replaced() -> None:
    robot = Robot()
    robot.orders.propose(to(7.0, 1), False, OLD, 0.0)
    assert robot.orders.hear(carried(to(8.0, 2), OLD), OLD, 0.1)
    assert not robot.orders.begin(NEW, 0.2)
    assert robot.orders.mission.goal_m == (8.0, 0.0)


def test_e32_of_two_orders_that_count_from_the_same_one_that_of_the_later_leader_holds_at_all() -> None:
    first, second, third = Robot(), Robot(), Robot()
    mine, other = to(7.0, 1), to(8.0, 1)
    second.orders.propose(other, False, OLD, 0.0)
    assert first.orders.propose(mine, True, OLD, 0.0)
    assert third.orders.hear(carried(mine, OLD), OLD, 0.1)
    assert second.orders.begin(NEW, 0.2), "the first leader is lost, and this one never heard its order"
    assert all(robot.orders.hear(carried(other, NEW), NEW, 0.3) for robot in (first, third))
    assert not third.orders.hear(carried(mine, OLD), OLD, 0.4), "nor does a late word of the first leader change it"
    assert first.orders.order == second.orders.order == third.orders.order == other


def test_e32_a_leader_that_says_no_order_is_told_of_it_once_it_had_time_to() -> None:
    robot, leader = Robot(), Robot()
    order = to(7.0, 1)
    robot.orders.hear(carried(order, OLD), OLD, 0.0)
    robot.orders.follow(OLD, 9.0)
    robot.orders.follow(NEW, 10.0)
    robot.orders.follow(NEW, 10.0 + REMIND_S - 0.01)
    assert robot.told() == []
    robot.orders.follow(NEW, 10.0 + REMIND_S)
    assert robot.told() == [(1, OLD)]
    leader.orders.begin(NEW, 10.0)
    assert leader.orders.hear_robot(carried(order, OLD), NEW, 12.0)
    assert leader.told() == [(1, NEW)]
    assert not leader.orders.hear_robot(carried(to(9.0, 1), OLD), NEW, 12.0)
    assert not robot.orders.hear(carried(order, NEW), NEW, 12.0), "it knows it"
    robot.orders.follow(NEW, 20.0)
    assert robot.told() == []


def test_e32_an_order_of_an_old_term_or_of_none_is_not_obeyed() -> None:
    robot = Robot()
    assert not robot.orders.hear(carried(to(8.0, 5), OLD), NEW, 0.0)
    assert not robot.orders.hear(OrderNote(Header("robot2", 1, 1, 0.0), to(8.0, 5)), NO_TERM, 0.0)
    assert robot.orders.mission == MISSION
