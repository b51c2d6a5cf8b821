"""The inbox: newest value for states, every message for the rest, bounded, and awake only for what is urgent."""

import threading

from protocol.bus import Arrival, Inbox
from protocol.node import PeerDown


def arrival(at: float, topic: str) -> Arrival:
    return Arrival(at, f"lfa/f/robot1/{topic}", b"")


def test_of_a_state_only_the_newest_value_is_kept() -> None:
    inbox = Inbox()
    for n in range(5):
        inbox.put(arrival(float(n), "pose"))
    assert [a.at for a in inbox.take()] == [4.0]
    assert inbox.take() == []


def test_every_lease_message_is_kept_in_order_of_arrival() -> None:
    inbox = Inbox()
    for n in range(5):
        inbox.put(arrival(float(n), "lease"))
    inbox.put(arrival(2.5, "pose"))
    assert [a.at for a in inbox.take()] == [0.0, 1.0, 2.0, 2.5, 3.0, 4.0]


def test_a_full_queue_drops_the_newcomer_and_counts_it() -> None:
    inbox = Inbox(size_max=3)
    for n in range(5):
        inbox.put(arrival(float(n), "lease"))
    assert [a.at for a in inbox.take()] == [0.0, 1.0, 2.0]
    assert inbox.dropped == 2


def test_only_what_acts_on_arrival_wakes_the_loop() -> None:
    wake = threading.Event()
    inbox = Inbox(wake)
    inbox.put(arrival(0.0, "sensors"))
    assert not wake.is_set()
    inbox.put(arrival(0.0, "lease"))
    assert wake.is_set()
    wake.clear()
    inbox.put(Arrival(0.0, "lfa/f/robot1/alive/3", PeerDown("robot1", 3)))
    assert wake.is_set()
