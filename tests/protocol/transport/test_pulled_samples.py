"""Subscriptions whose samples wait until their reader asks for them, over a real router."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from lfa.protocol import clock
from lfa.protocol.topics import key
from lfa.protocol.transport.bus import Arrival, Inbox
from lfa.protocol.transport.zenoh_bus import ZenohBus
from lfa.protocol.transport.zenoh_config import answers
from tests.protocol.transport.test_zenoh_threads import router

PATIENCE_S = 20.0
POSES, COMMANDS, EVENTS = key("f", "*", "pose"), key("f", "*", "cmd_vel"), key("f", "*", "event")
PULLED = frozenset({POSES, COMMANDS})


@pytest.fixture
def buses() -> Iterator[tuple[ZenohBus, ZenohBus, Inbox]]:
    """Yield a sender, a reader that follows nothing yet, and the reader's inbox."""
    inbox = Inbox(every=True)
    with router() as endpoint:
        until = clock.now() + PATIENCE_S
        while not answers(endpoint) and clock.now() < until:
            clock.sleep(0.01)
        sender, reader = ZenohBus(endpoint, Inbox()), ZenohBus(endpoint, inbox)
        try:
            yield sender, reader, inbox
        finally:
            sender.close()
            reader.close()


def arrived(inbox: Inbox, before: Callable[[], None]) -> list[Arrival]:
    """Return the next arrivals, calling `before` each time before looking. Raises AssertionError after PATIENCE_S."""
    until = clock.now() + PATIENCE_S
    while clock.now() < until:
        before()
        found = inbox.take()
        if found:
            return found
        clock.sleep(0.01)
    raise AssertionError(f"nothing arrives within {PATIENCE_S:g} s")


def test_samples_wait_for_pull_and_of_a_state_only_the_newest_comes(buses: tuple[ZenohBus, ZenohBus, Inbox]) -> None:
    sender, reader, inbox = buses
    reader.follow(PULLED | {EVENTS}, PULLED)
    arrived(inbox, lambda: sender.publish("lfa/f/robot1/event", b"declared"))
    for n in range(3):
        for robot in ("robot1", "robot2"):
            sender.publish(f"lfa/f/{robot}/pose", b"%d" % n)
        sender.publish("lfa/f/robot1/cmd_vel", b"%d" % n)
    sender.publish("lfa/f/robot1/event", b"last")  # the least urgent: it comes behind them all
    while (came := arrived(inbox, lambda: None))[-1].payload != b"last":
        assert {arrival.payload for arrival in came} == {b"declared"}
    for expression in sorted(PULLED):
        reader.pull(expression)
    told = [(arrival.key.partition("robot")[2], arrival.payload) for arrival in inbox.take()]
    assert [payload for name, payload in told if name == "1/cmd_vel"] == [b"0", b"1", b"2"]
    assert sorted(one for one in told if "pose" in one[0]) == [("1/pose", b"2"), ("2/pose", b"2")]


def test_pulled_samples_come_also_after_the_subscriptions_were_renewed(
    buses: tuple[ZenohBus, ZenohBus, Inbox],
) -> None:
    sender, reader, inbox = buses
    reader.follow(PULLED, PULLED)
    reader.resubscribe()

    def say_and_pull() -> None:
        sender.publish("lfa/f/robot1/pose", b"1")
        reader.pull(POSES)

    assert arrived(inbox, say_and_pull)[0].key == "lfa/f/robot1/pose"


def test_what_is_not_followed_is_not_pulled(buses: tuple[ZenohBus, ZenohBus, Inbox]) -> None:
    _, reader, inbox = buses
    reader.follow(frozenset(), PULLED)
    reader.pull(POSES)
    assert inbox.take() == []
