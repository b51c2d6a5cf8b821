"""Every publisher counts its messages on each topic by itself, and a driver speaks on its robot's keys."""

from __future__ import annotations

from lfa.protocol.outbox import Outbox


def test_each_topic_has_its_own_numbers_without_a_gap() -> None:
    outbox = Outbox("fleet", "robot1", 5, first=1)
    topics = ("pose", "event", "pose", "pose", "event")
    assert [outbox.header(topic, 0.0).seq for topic in topics] == [1, 1, 2, 3, 2]


def test_a_sender_may_speak_on_the_keys_of_another() -> None:
    outbox = Outbox("fleet", "driver1", 5, "robot1")
    assert outbox.header("sensors", 2.5).sender == "driver1"
    assert outbox.key("sensors") == "lfa/fleet/robot1/sensors"


def test_what_is_published_is_drained_once_in_its_order() -> None:
    outbox = Outbox("fleet", "robot1", 5)
    outbox.event("first", 0.0, None, {})
    outbox.event("second", 0.0, None, {})
    assert [envelope.message.kind for envelope in outbox.drain()] == ["first", "second"]
    assert outbox.drain() == []
