"""Publishers, subscriptions, services and clients over real Zenoh sessions."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest

from lfa.deploy.ros import session as sessions
from lfa.deploy.ros.graph import RosGraph
from lfa.deploy.ros.session import RosSpace, RosSubscription
from lfa.deploy.ros.types import kind
from lfa.deploy.ros.wire import LATCHED, TOKENS, read_attachment
from lfa.protocol.errors import Refused
from lfa.protocol.transport.zenoh_ros import ros_session
from tests.rigs.ros_peers import awaited, free_endpoint, ros_pair

STRING, TRIGGER = "std_msgs/msg/String", "std_srvs/srv/Trigger"
HOSTILE = (b"", b"\x00", bytes(10), b"\xff" * 33, b"sequence_number:1", bytes(4000))


@pytest.fixture
def pair() -> Iterator[tuple[RosSpace, RosSpace]]:
    with ros_pair() as spaces:
        yield spaces


def text(words: str) -> Any:
    return kind(STRING)(words)


def test_a_subscriber_hears_what_is_published_and_the_publisher_knows_it(pair: tuple[RosSpace, RosSpace]) -> None:
    ours, theirs = pair
    publisher = ours.node("bridge").publisher("/x", STRING)
    assert not publisher.heard()
    subscription = theirs.node("user").subscription("/x", STRING)
    awaited(publisher.heard, "the subscription matches")
    publisher.publish(text("hi"))
    (message,) = awaited(subscription.take, "the message arrives")
    assert message.data == "hi"


def test_a_late_subscriber_gets_the_newest_message_of_a_latched_topic_in_both_directions(
    pair: tuple[RosSpace, RosSpace],
) -> None:
    for n, (one, other) in enumerate((pair, pair[::-1])):
        publisher = one.node("map").publisher(f"/map{n}", STRING, LATCHED)
        publisher.publish(text("old"))
        publisher.publish(text("new"))
        subscription = other.node("late").subscription(f"/map{n}", STRING, LATCHED)
        got: list[str] = []

        def newest_came(subscription: RosSubscription = subscription, got: list[str] = got) -> bool:
            got.extend(message.data for message in subscription.take())
            return "new" in got

        awaited(newest_came, "the latched message")
        assert got[-1] == "new", "what was still on its way may come before the newest, nothing after it"


def test_a_service_answers_with_the_number_and_the_gid_of_its_caller(pair: tuple[RosSpace, RosSpace]) -> None:
    ours, theirs = pair
    service = ours.node("bridge").service("/lfa/handover", TRIGGER)
    client = theirs.node("user").client("/lfa/handover", TRIGGER)
    answers: list[Any] = []
    asking = threading.Thread(target=lambda: answers.append(client.call(kind("std_srvs/msg/Trigger_Request")(0), 10.0)))
    asking.start()
    for call in awaited(service.take, "the call arrives"):
        call.answer(kind("std_srvs/msg/Trigger_Response")(success=True, message="done"))
    asking.join()
    assert (answers[0].success, answers[0].message) == (True, "done")


def test_numbers_begin_at_one_and_every_attachment_has_33_bytes(pair: tuple[RosSpace, RosSpace]) -> None:
    ours, theirs = pair
    attached: list[bytes] = []
    theirs.session.subscriber("0/x/**", lambda _key, _payload, attachment: attached.append(attachment), kept=None)
    publisher = ours.node("bridge").publisher("/x", STRING)
    awaited(publisher.heard, "the subscription matches")
    for _ in range(3):
        publisher.publish(text("hi"))
    awaited(lambda: len(attached) == 3, "three messages arrive")
    read = [read_attachment(one) for one in attached]
    assert [one.number for one in read if one is not None] == [1, 2, 3]
    assert len({one.gid for one in read if one is not None}) == 1


def test_the_graph_shows_nodes_and_endpoints_until_they_are_closed(pair: tuple[RosSpace, RosSpace]) -> None:
    ours, theirs = pair
    graph = RosGraph()
    theirs.session.tokens(f"{TOKENS}/**", lambda token, up: graph.update(token, up=up))
    node = ours.node("lfa", "/robot1")
    node.publisher("/robot1/odom", "nav_msgs/msg/Odometry")
    awaited(lambda: graph.endpoints("MP", "/robot1/odom"), "the publisher is listed")
    assert [one.full_name for one in graph.nodes()] == ["/robot1/lfa"]
    node.close()
    awaited(lambda: not graph.nodes() and not graph.endpoints("MP"), "node and publisher vanish")


def test_any_bytes_on_a_topic_are_counted_and_dropped(pair: tuple[RosSpace, RosSpace]) -> None:
    ours, theirs = pair
    node = ours.node("bridge")
    subscription = node.subscription("/goal_pose", "geometry_msgs/msg/PoseStamped")
    key = theirs.node("user").publisher("/goal_pose", "geometry_msgs/msg/PoseStamped")._publication
    awaited(key.matched, "the subscription matches")
    for payload in HOSTILE:
        key.put(payload, payload)
    awaited(lambda: ours.counters.received == len(HOSTILE), "all samples arrive")
    assert subscription.take() == []
    assert ours.counters.undecodable == len(HOSTILE)


def test_any_bytes_as_a_call_are_counted_and_not_answered(pair: tuple[RosSpace, RosSpace]) -> None:
    ours, _ = pair
    service = ours.node("bridge").service("/lfa/handover", TRIGGER)

    class Query:
        payload, key = b"\x00\x01\x00\x00\x00", "0/lfa/handover"

        def __init__(self, attachment: bytes) -> None:
            self.attachment = attachment

        def reply(self, payload: bytes, attachment: bytes) -> None:
            raise AssertionError("answered")

    for attachment in HOSTILE:
        service._queue.put(Query(attachment))  # type: ignore[arg-type]
    assert service.take() == []
    assert ours.counters.undecodable == len(HOSTILE)


def test_a_flood_of_samples_is_bounded(pair: tuple[RosSpace, RosSpace], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sessions, "QUEUE_MAX", 3)
    ours, _ = pair
    subscription = ours.node("bridge").subscription("/x", STRING)
    for n in range(5):
        subscription._receive("", bytes([n]), b"")
    assert ours.counters.dropped == 2


def test_without_a_router_it_is_refused_in_one_line() -> None:
    with pytest.raises(Refused, match=r"no ROS router answers: start one .* or give --serve"):
        ros_session(free_endpoint(), serve=False)


def test_a_port_that_is_taken_is_refused_in_one_line() -> None:
    endpoint = free_endpoint()
    first = ros_session(endpoint, serve=True)
    try:
        with pytest.raises(Refused, match="another router or bridge holds the port"):
            ros_session(endpoint, serve=True)
    finally:
        first.close()
