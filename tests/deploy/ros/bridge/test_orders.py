"""OperatorInput of ROS users over real sessions: what is passed on to the fleet, and what is answered."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from math import nan, pi
from typing import Any

import pytest

from lfa.deploy.ros import messages
from lfa.deploy.ros.bridge.answers import answer
from lfa.deploy.ros.bridge.command import check_graph
from lfa.deploy.ros.bridge.inward import HANDOVER_S_MAX, OperatorInput
from lfa.deploy.ros.bridge.outward import RosOutput
from lfa.deploy.ros.bridge.stop_calls import RESUME, STOP
from lfa.deploy.ros.session import GraphFeed, RosSpace, ServiceCall
from lfa.deploy.ros.types import from_cdr, kind
from lfa.protocol.errors import Refused
from lfa.protocol.geometry import Pose2D
from tests.rigs.ros_peers import awaited, ros_pair


class Fleet:
    """Records what the fleet is told."""

    def __init__(self, space: RosSpace) -> None:
        self.told: list[tuple[str, dict[str, object]]] = []
        self.warned: list[str] = []
        self.goals: list[tuple[float, float, float]] = []
        self.orders = OperatorInput(space.node("lfa_bridge"), self)

    def order(self, name: str, **arguments: object) -> None:
        self.told.append((name, arguments))

    def stop(self, call: ServiceCall, now: float, *, stand: bool) -> None:
        self.told.append(("stop", {"stand": stand}))
        answer(call, success=True, text=f"asked at {now:g}")

    def pause(self, call: ServiceCall, now: float, *, paused: bool) -> None:
        self.told.append(("pause", {"paused": paused}))
        answer(call, success=True, text=f"asked at {now:g}")

    def go(self, x: float, y: float, theta_deg: float, now: float) -> None:
        if x > 100.0:
            raise Refused("outside of the map")
        self.goals.append((x, y, theta_deg))

    def warn(self, words: str) -> None:
        self.warned.append(words)


@pytest.fixture
def pair() -> Iterator[tuple[RosSpace, RosSpace]]:
    with ros_pair() as spaces:
        yield spaces


def test_a_formation_is_ordered_and_nonsense_is_warned_of(pair: tuple[RosSpace, RosSpace]) -> None:
    ours, theirs = pair
    fleet = Fleet(ours)
    publisher = theirs.node("user").publisher("/lfa/formation/set", "std_msgs/msg/String")
    awaited(publisher.heard, "the subscription matches")
    for words in ("column", "x" * 5000):
        publisher.publish(kind("std_msgs/msg/String")(words))

    def decided() -> bool:
        fleet.orders.step(1, 0.0)
        return bool(fleet.told and fleet.warned)

    awaited(decided, "both are read")
    assert fleet.told == [("formation", {"side": "column"})]
    (warning,) = fleet.warned
    assert "/lfa/formation/set" in warning
    assert len(warning) < 200


@pytest.mark.parametrize(
    ("leaders", "success", "words"),
    [((1, 2), True, "robot 2 leads"), ((1, 1), False, "robot 1 still leads"), ((0, 0), False, "nobody leads")],
)
def test_a_hand_over_is_answered_by_what_came_of_it(
    leaders: tuple[int, int], success: bool, words: str, pair: tuple[RosSpace, RosSpace]
) -> None:
    ours, theirs = pair
    fleet = Fleet(ours)
    client = theirs.node("user").client("/lfa/handover", "std_srvs/srv/Trigger")
    answers: list[Any] = []
    asking = threading.Thread(target=lambda: answers.append(client.call(kind("std_srvs/msg/Trigger_Request")(0), 15.0)))
    asking.start()

    def asked() -> bool:
        fleet.orders.step(leaders[0], 0.0)
        return bool(fleet.told or answers)

    awaited(asked, "the call arrives")
    fleet.orders.step(leaders[1], HANDOVER_S_MAX + 1.0)
    asking.join()
    assert answers[0].success is success
    assert words in answers[0].message
    assert fleet.told == ([("handover", {})] if leaders[0] else [])


def test_a_second_bridge_and_nodes_of_another_distribution_are_refused(pair: tuple[RosSpace, RosSpace]) -> None:
    ours, theirs = pair
    graph = GraphFeed(theirs)
    RosOutput(ours, tf_per_robot=False, sim_time=False)
    awaited(lambda: graph.poll(0.0).nodes(), "the bridge is listed")
    with pytest.raises(Refused, match="another bridge is on domain 0"):
        check_graph(graph, "jazzy", 0.0)


def test_nodes_of_humble_are_named_to_a_newer_bridge() -> None:
    with ros_pair("humble") as (ours, theirs):
        graph = GraphFeed(theirs)
        ours.node("talker").publisher("/chatter", "std_msgs/msg/String")
        awaited(lambda: graph.poll(0.0).hashless(), "the node of Humble is listed")
        with pytest.raises(Refused, match=r"/talker speaks another key format.*--distro humble"):
            check_graph(graph, "jazzy", 0.0)
        check_graph(graph, "humble", 0.0)


def test_a_robot_that_leaves_vanishes_from_the_graph(pair: tuple[RosSpace, RosSpace]) -> None:
    ours, theirs = pair
    graph = GraphFeed(theirs)
    output = RosOutput(ours, tf_per_robot=True, sim_time=True)
    output.join(2)
    awaited(lambda: graph.poll(0.0).endpoints("MP", "/robot2/tf"), "the robot is listed")
    assert not output.heard("/robot2/odom")
    output.leave(2)
    awaited(lambda: not graph.poll(0.0).endpoints("MP", "/robot2/tf"), "the robot vanishes")
    assert graph.poll(0.0).endpoints("MP", "/clock")


def test_of_a_resume_and_a_stop_that_wait_together_the_stop_is_the_last_word(pair: tuple[RosSpace, RosSpace]) -> None:
    ours, theirs = pair
    fleet, user = Fleet(ours), theirs.node("user")
    clients = [user.client(service, "std_srvs/srv/Trigger") for service in (STOP, RESUME)]
    calls = [
        threading.Thread(target=client.call, args=(kind("std_srvs/msg/Trigger_Request")(0), 15.0)) for client in clients
    ]
    for call in calls:
        call.start()
    awaited(lambda: ours.counters.received == len(calls), "both calls arrive")
    fleet.orders.step(1, 0.0)
    for call in calls:
        call.join()
    assert fleet.told == [("stop", {"stand": False}), ("stop", {"stand": True})]


def goal(x: float, y: float, yaw: float, frame: str = "map") -> Any:
    message = from_cdr(*reversed(messages.pose_stamped(0, Pose2D(x, y, yaw))))
    message.header.frame_id = frame
    return message


@pytest.mark.parametrize(
    ("message", "goals", "warning"),
    [
        (goal(3.0, -1.5, pi / 2), [(3.0, -1.5, 90.0)], None),
        (goal(3.0, -1.5, 0.0, "odom"), [], "/goal_pose: frame 'odom': must be 'map'"),
        (goal(3.0, -1.5, nan), [], "/goal_pose: orientation: must be a quaternion"),
        (goal(101.0, 0.0, 0.0), [], "/goal_pose: outside of the map"),
    ],
    ids=["in map", "in another frame", "no rotation", "refused"],
)
def test_a_goal_of_rviz_is_passed_on_or_warned_of_in_one_line(
    message: Any, goals: list[tuple[float, ...]], warning: str | None, pair: tuple[RosSpace, RosSpace]
) -> None:
    ours, theirs = pair
    fleet = Fleet(ours)
    publisher = theirs.node("rviz").publisher("/goal_pose", "geometry_msgs/msg/PoseStamped")
    awaited(publisher.heard, "the subscription matches")
    publisher.publish(message)

    def decided() -> bool:
        fleet.orders.step(1, 0.0)
        return bool(fleet.goals or fleet.warned)

    awaited(decided, "the goal is read")
    assert [tuple(round(number, 6) for number in one) for one in fleet.goals] == goals
    assert [line.startswith(warning or "?") for line in fleet.warned] == [True] * (warning is not None)
