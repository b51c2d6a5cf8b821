"""When subscriptions are declared again, and how they are spelled then."""

from __future__ import annotations

import subprocess
import sys
from itertools import pairwise

import pytest
import zenoh

from lfa.protocol.node import PeerDown, PeerUp, RouterLost
from lfa.protocol.topics import TOPICS, alive_key, key
from lfa.protocol.transport.links import AGAIN_S, ANEW_S, NAMES_MAX, Links
from lfa.protocol.transport.spelling import TURNS, respelled


@pytest.mark.parametrize(
    ("events", "last_s"),
    [
        (["up 1"], None),
        (["lost"], None),
        (["down 1"], 0.0),
        (["down 1", "up 2"], 0.0),
        (["down 1", "up 1"], 1.0),
        (["down 1", "up 1", "up 1"], 1.0),
        (["lost", "up 1"], 1.0),
    ],
)
def test_what_is_followed_is_told_anew_twice_after_a_token_went_or_came_back(
    events: list[str], last_s: float | None
) -> None:
    links = Links()
    kinds = {"up": PeerUp, "down": PeerDown}
    for at, event in enumerate(events):
        kind, _, life = event.partition(" ")
        links.see(kinds[kind]("robot2", int(life)) if life else RouterLost(), float(at))
    for after_s in () if last_s is None else ANEW_S:
        assert not links.due(last_s + after_s - 0.001)  # type: ignore[operator]
        assert links.due(last_s + after_s)  # type: ignore[operator]
    assert not links.due(1000.0)


def test_a_process_that_lacks_messages_declares_again_and_again_at_a_bounded_rate() -> None:
    links = Links()
    told: list[float] = []
    for step in range(1200):
        now = step * 0.1
        links.lacks(True, now)
        if links.due(now):
            told.append(now)
    gaps = [after - before for before, after in pairwise(told)]
    assert told[0] == pytest.approx(AGAIN_S[0])
    assert gaps == sorted(gaps) and max(gaps) <= AGAIN_S[1] + 0.2
    assert len(told) >= 120.0 / AGAIN_S[1], "it gave up"


def test_a_process_that_lacks_nothing_any_more_falls_silent_and_begins_anew_the_next_time() -> None:
    links = Links()
    links.lacks(True, 0.0)
    assert links.due(AGAIN_S[0])
    links.lacks(False, AGAIN_S[0] + 1.0)
    assert not links.due(1000.0)
    links.lacks(True, 1000.0)
    assert links.anew_at == 1000.0 + AGAIN_S[0]


FOLLOWED = [
    *(f"lfa/f/*/{topic.name}" for topic in TOPICS),
    *(f"lfa/f/*/lease/{to}" for to in ("all", "hello", "robot12")),
    "lfa/f/robot3/pose",
    "lfa/f/**",
]
KEYS = [key("f", "robot3", topic.name) for topic in TOPICS] + [
    *(key("f", "robot3", "lease", to) for to in ("all", "hello", "robot12", "robot1", "robot112")),
    alive_key("f", "robot3", 7),
    "lfa/g/robot3/pose",
]


@pytest.mark.parametrize("expression", FOLLOWED)
def test_another_spelling_matches_the_same_keys(expression: str) -> None:
    found = {respelled(expression, f"robot{n}", turn) for n in range(1, 9) for turn in range(TURNS)}
    assert len(found) >= 3
    for spelling in found:
        told = zenoh.KeyExpr(spelling)  # raises if it is none
        assert [told.intersects(key) for key in KEYS] == [zenoh.KeyExpr(expression).intersects(key) for key in KEYS]
        assert zenoh.KeyExpr("lfa/f/**").includes(told), "the rules of a secure router would refuse it"


LOST = """
import os, socket
os.environ["ZENOH_RUNTIME"] = "(rx: (worker_threads: 4))"
import zenoh
from lfa.protocol import clock
from lfa.protocol.transport.bus import Inbox
from lfa.protocol.transport.zenoh_bus import ZenohBus
from lfa.protocol.transport.zenoh_config import insert_settings, session_config

HELLO = "lfa/f/*/lease/hello"

def free():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"

def router(listen, connect, settings):
    config = session_config("router", [listen], connect, 1000, None)
    insert_settings(config, settings)
    return zenoh.open(config)

lost = {"id": "lost", "permission": "deny", "flows": ["ingress"], "messages": ["declare_subscriber"]}
lost["key_exprs"] = [HELLO]
link = {"id": "link", "link_protocols": ["tcp"]}
guard = {"enabled": True, "default_permission": "allow", "rules": [lost], "subjects": [link]}
guard["policies"] = [{"rules": ["lost"], "subjects": ["link"]}]
here, there = free(), free()
routers = [router(here, [], {}), router(there, [here], {"access_control": guard})]
inboxes = [Inbox(every=True), Inbox(every=True)]
leader, neighbour = [ZenohBus(here, inbox) for inbox in inboxes]
for bus in (leader, neighbour):
    bus.follow(frozenset({HELLO, "lfa/f/*/table"}))
robot = ZenohBus(there, Inbox())

def heard(inbox, topic, within_s):
    until = clock.now() + within_s
    while clock.now() < until:
        robot.publish("lfa/f/robot7/table", b"")
        robot.publish("lfa/f/robot7/lease/hello", b"")
        clock.sleep(0.02)
        if any(arrival.key.endswith(topic) for arrival in inbox.take()):
            return True
    return False

assert heard(inboxes[0], "table", 20.0), "no link"
assert not heard(inboxes[0], "hello", 0.5), "nothing was lost"
leader.resubscribe()
print(heard(inboxes[0], "hello", 20.0))
for one in (leader, neighbour, robot, *routers[::-1]):
    one.close()
"""


def test_a_declaration_that_a_link_lost_comes_back_though_a_neighbour_follows_the_same() -> None:
    """The link loses HELLO, by a rule of the far router; both clients of the near one have declared it."""
    done = subprocess.run([sys.executable, "-c", LOST], capture_output=True, text=True, timeout=90, check=False)
    assert done.stdout.strip() == "True", done.stdout + done.stderr


def test_vanished_tokens_of_numbers_without_end_take_no_memory_without_end() -> None:
    links = Links()
    for n in range(5000):
        links.see(PeerDown("robot3", n), 0.0)
        links.see(PeerDown(f"robot{n}", 1), 0.0)
    assert len(links._gone) <= NAMES_MAX
