"""The inbox: newest value for states, every message for the rest, bounded, and awake only for what is urgent."""

import signal
import threading
from random import Random

import pytest

from lfa.protocol.lease.effects import Send
from lfa.protocol.messages.consensus import Hello, Release, Term
from lfa.protocol.node import PeerDown, PeerUp, RouterLost
from lfa.protocol.transport.bus import (
    OWNER_BURST_MAX,
    OWNER_RATE_MAX_HZ,
    OWNERS_MAX,
    TOKEN_HOLD_S,
    TOKEN_OWNERS_MAX,
    TOKENS_MAX,
    TOLD_MAX,
    Arrival,
    Inbox,
    Tokens,
    Wake,
)


def arrival(at: float, topic: str) -> Arrival:
    return Arrival(at, f"lfa/f/robot1/{topic}", b"")


@pytest.mark.parametrize(
    ("to", "defers", "wakes"),
    [
        ("hello", "hellos", False),
        ("hello", "grants rounds", True),
        ("robot1", "grants", False),  # GRANT, and any other answer to this process alone
        ("robot1", "hellos rounds", True),
        ("all", "rounds", False),  # PROPOSE, PREPARE, RELEASE, FENCED
        ("all", "hellos grants", True),
    ],
)
def test_the_key_alone_decides_which_lease_messages_can_wait(to: str, defers: str, wakes: bool) -> None:
    wake = Wake()
    inbox = Inbox(wake, defer_hellos="hellos" in defers)
    inbox.defer_grants, inbox.defer_rounds = "grants" in defers, "rounds" in defers
    inbox.put(Arrival(0.0, f"lfa/f/robot2/lease/{to}", b"no message at all"))
    assert wake.wait(0.0) is wakes
    assert len(inbox.take()) == 1


def test_hello_has_a_receiver_of_its_own_in_its_key() -> None:
    assert Send("all", Hello(None)).receiver == "hello"
    assert Send("all", Release(Term(1, 1, 1))).receiver == "all"


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


def token(at: float, peer: PeerDown | PeerUp) -> Arrival:
    return Arrival(at, f"lfa/f/{peer.name}/alive/{peer.incarnation}", peer)


def told(arrivals: list[Arrival]) -> list[object]:
    return [arrival.payload for arrival in arrivals]


def test_a_routers_death_is_not_everyones_death() -> None:
    """In the order and at the distances that a killed router was measured to make them."""
    tokens = Tokens()
    gone = [token(1.0 + n * 2e-5, PeerDown(f"robot{n}", 3)) for n in (1, 2, 3)]
    assert tokens.debounce(gone, 1.0001) == []
    assert tokens.next_due() == gone[0].at + TOKEN_HOLD_S
    assert told(tokens.debounce([Arrival(1.0002, "", RouterLost())], 1.01)) == [RouterLost()]
    assert tokens.debounce([token(1.02, PeerDown("robot4", 3))], 1.1) == [], "cut off: this says nothing about robot 4"
    assert tokens.next_due() == float("inf")


def test_a_token_that_vanished_is_believed_after_a_millisecond() -> None:
    tokens = Tokens()
    assert tokens.debounce([token(1.0, PeerDown("robot1", 3))], 1.0) == []
    assert told(tokens.debounce([arrival(1.0005, "lease")], 1.0006)) == [b""]
    assert told(tokens.debounce([arrival(1.002, "lease")], 1.002)) == [PeerDown("robot1", 3), b""]


def test_a_token_that_comes_back_at_once_never_vanished() -> None:
    tokens = Tokens()
    back = PeerUp("robot1", 3)
    assert told(tokens.debounce([token(1.0, PeerDown("robot1", 3)), token(1.0002, back)], 1.1)) == [back]


def test_after_the_link_is_back_a_vanished_token_is_a_hint_again() -> None:
    tokens = Tokens()
    tokens.debounce([Arrival(1.0, "", RouterLost())], 1.0)
    tokens.debounce([token(2.0, PeerUp("robot1", 3))], 2.0)
    tokens.debounce([token(3.0, PeerDown("robot1", 3))], 3.0)
    assert told(tokens.debounce([], 3.1)) == [PeerDown("robot1", 3)]


def test_a_signal_at_any_moment_of_the_wait_wakes_the_loop() -> None:
    """`threading.Event` stops for good here: its handler waits for a lock that the interrupted code holds."""
    wake, random = Wake(), Random(1)
    before = signal.signal(signal.SIGALRM, lambda *_: wake.set())
    try:
        for n in range(2000):
            signal.setitimer(signal.ITIMER_REAL, random.uniform(1e-6, 1e-4))
            # One that comes just before the wait is heard after it: the loop's waits are short.
            assert wake.wait(2e-5) or wake.wait(0.005) or wake.wait(1.0), f"signal {n} was not heard"
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def test_who_floods_is_heard_less_and_nobody_else_is() -> None:
    inbox = Inbox(size_max=10**6)
    seconds, per_s = 4, 20_000
    for n in range(seconds * per_s):
        inbox.put(Arrival(n / per_s, "lfa/f/robot1/lease/all", b""))
        if n % 400 == 0:
            inbox.put(Arrival(n / per_s, "lfa/f/robot2/lease/all", b""))
    heard = [a.key.split("/")[2] for a in inbox.take()]
    assert heard.count("robot2") == seconds * per_s // 400
    assert heard.count("robot1") <= OWNER_BURST_MAX + OWNER_RATE_MAX_HZ * seconds
    assert inbox.dropped == seconds * per_s - heard.count("robot1")


def test_a_recorder_hears_a_flood_whole() -> None:
    inbox = Inbox(size_max=10**6, every=True)
    for n in range(5000):
        inbox.put(Arrival(n * 1e-5, "lfa/f/robot1/lease/all", b""))
    assert len(inbox.take()) == 5000


def test_names_without_end_take_no_memory_without_end() -> None:
    inbox = Inbox()
    for n in range(10 * OWNERS_MAX):
        inbox.put(Arrival(0.0, f"lfa/f/stranger{n}/lease/all", b""))
    assert len(inbox._allowances) <= OWNERS_MAX


def test_of_one_members_tokens_only_a_few_come_in_and_the_rest_is_counted_once_each() -> None:
    inbox = Inbox(size_max=10**6)
    for n in range(20_000):
        inbox.put(token(n / 100.0, PeerUp("robot3", n)))
    inbox.put(token(200.0, PeerUp("robot2", 7)))
    assert len(inbox.take()) == TOKENS_MAX + 1
    assert inbox.refused == (("robot3", 20_000 - TOKENS_MAX),)
    for n in range(20_000):
        inbox.put(token(200.0 + n / 100.0, PeerDown("robot3", n)))
    assert {a.payload.incarnation for a in inbox.take()} >= set(range(TOKENS_MAX))  # type: ignore[union-attr]
    inbox.put(token(500.0, PeerUp("robot3", 99)))
    assert len(inbox.take()) == 1, "there is room again"


def test_tokens_of_names_without_end_take_no_memory_without_end() -> None:
    inbox = Inbox(size_max=10**6)
    for n in range(4 * TOKEN_OWNERS_MAX):
        inbox.put(token(0.0, PeerUp(f"robot{n}", 1)))
    assert len(inbox.take()) == TOKEN_OWNERS_MAX
    assert len(inbox._refused) <= OWNERS_MAX


def test_those_of_whom_most_was_refused_are_named() -> None:
    inbox = Inbox(size_max=10**6)
    for robot in range(1, 6):
        for _ in range(int(OWNER_BURST_MAX) + robot):
            inbox.put(Arrival(0.0, f"lfa/f/robot{robot}/lease/all", b""))
    assert inbox.refused == tuple((f"robot{n}", n) for n in (5, 4, 3))
    assert len(inbox.refused) == TOLD_MAX
