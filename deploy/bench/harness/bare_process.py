"""Process that receives and publishes as many bytes on as many keys as an agent, at 50 Hz, without any computation.

It is the baseline of an agent's cost: no robot in Python over Zenoh costs less.
"""

from __future__ import annotations

import sys
from typing import NoReturn

import msgspec
from msgspec import Struct

from lfa.protocol import clock
from lfa.protocol.transport.bus import Inbox, Wake
from lfa.protocol.transport.zenoh_bus import ZenohBus

PERIOD_S = 0.02


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


def main(task: BareTask) -> NoReturn:
    """Receive and publish until the process is killed."""
    wake = Wake()
    inbox = Inbox(wake, defer_hellos=True)
    bus = ZenohBus(task.endpoint, inbox)
    bus.follow(frozenset(task.hears))
    owed = dict.fromkeys(task.says, 0.0)
    step_at = clock.now()
    while True:
        wake.wait(max(step_at - clock.now(), 0.0))
        inbox.take()
        if clock.now() < step_at:
            continue
        step_at = max(step_at + PERIOD_S, clock.now())
        for saying in task.says:
            owed[saying] += saying.rate_hz * PERIOD_S
            while owed[saying] >= 1.0:
                owed[saying] -= 1.0
                bus.publish(saying.key, bytes(saying.size))


if __name__ == "__main__":
    main(msgspec.json.decode(sys.argv[1], type=BareTask))
