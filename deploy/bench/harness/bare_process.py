"""Process that receives and publishes as many bytes on as many keys as another, without any computation.

It is the baseline of an agent's cost, and of the bridge's to ROS: no such process in Python over Zenoh costs less.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import NoReturn

import msgspec
from msgspec import Struct

from lfa.protocol import clock
from lfa.protocol.runtime.vital_signs import keep_one_heap
from lfa.protocol.transport.bus import Inbox, Wake
from lfa.protocol.transport.zenoh_bus import ZenohBus
from lfa.protocol.transport.zenoh_ros import RosPublication, RosSession

PERIOD_S = 0.02
ATTACHMENT = bytes(33)
"""What goes with each message to ROS; only the bench subscribes."""


class Saying(Struct, frozen=True):
    """Message stream to publish: key, message size and rate."""

    key: str
    size: int
    """Size [bytes] of one message."""
    rate_hz: float


class BareTask(Struct, frozen=True):
    """Task of the process, passed as its only argument in JSON."""

    endpoint: str
    hears: tuple[str, ...]
    """Key expressions to subscribe to."""
    says: tuple[Saying, ...]
    serves: str = ""
    """Endpoint at which it is a ROS router, and publishes there; empty: it publishes where it receives."""
    waits: tuple[str, ...] = ()
    """Those of `hears` whose samples wait for the next period, of a state topic the newest."""
    relays: dict[str, str] = {}
    """Keys whose bytes are published as they are, as soon as they come, each with the key to publish them on."""


def main(task: BareTask) -> NoReturn:
    """Receive and publish until the process is killed."""
    if task.serves:
        keep_one_heap()
    wake = Wake()
    inbox = Inbox(wake, defer_hellos=True, eager=frozenset(key.rpartition("/")[2] for key in task.relays))
    bus = ZenohBus(task.endpoint, inbox)
    session = RosSession(task.serves, serve=True) if task.serves else None  # Zenoh closes what nothing refers to
    say = bus.publish if session is None else _to_ros(session, task)
    bus.follow(frozenset(task.hears), frozenset(task.waits))
    owed = dict.fromkeys(task.says, 0.0)
    step_at = clock.now()
    while True:
        wake.wait(max(step_at - clock.now(), 0.0))
        for arrival in inbox.take():
            if arrival.key in task.relays and isinstance(arrival.payload, bytes):
                say(task.relays[arrival.key], arrival.payload)
        if clock.now() < step_at:
            continue
        step_at = max(step_at + PERIOD_S, clock.now())
        for key in task.waits:
            bus.pull(key)
        for saying in task.says:
            owed[saying] += saying.rate_hz * PERIOD_S
            while owed[saying] >= 1.0:
                owed[saying] -= 1.0
                say(saying.key, bytes(saying.size))


def _to_ros(session: RosSession, task: BareTask) -> Callable[[str, bytes], None]:
    """Return a function that publishes bytes on a key of the ROS side."""
    keys = {*(saying.key for saying in task.says), *task.relays.values()}
    publications: dict[str, RosPublication] = {
        key: session.publisher(key, reliable=True, kept=None) for key in sorted(keys)
    }
    return lambda key, payload: publications[key].put(payload, ATTACHMENT)


if __name__ == "__main__":
    main(msgspec.json.decode(sys.argv[1], type=BareTask))
