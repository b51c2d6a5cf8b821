"""Process with the traffic of some robots and nothing else: it publishes theirs, and counts what they receive.

Each robot publishes `SAYS` at a rate and hears its predecessor's poses and the world's sensors, the traffic that grows
with the team.
"""

from __future__ import annotations

import sys
from itertools import chain

import msgspec
from msgspec import Struct

from lfa.protocol import clock
from lfa.protocol.names import robot_name
from lfa.protocol.topics import key
from lfa.protocol.transport.bus import Arrival, Inbox
from lfa.protocol.transport.zenoh_bus import ZenohBus

SAYS = {"pose": 180, "cmd_vel": 130, "tracking": 170, "sensors": 160}
"""Size [bytes] of a robot's messages by topic; its sensors are published in its place, as a driver of its own does."""
HEARS = ("pose", "cmd_vel", "sensors")
"""Topics that another process hears of each robot: its successor, its gateway, itself."""
INBOX_MAX = 1_000_000
SETTLE_S = 2.0
"""Time [s] for declarations to spread before, and for messages to arrive after."""


class TrafficTask(Struct, frozen=True):
    """Task of the process: robots whose traffic it publishes, and robots that it hears."""

    endpoint: str
    fleet: str
    says: tuple[int, ...]
    hears: tuple[int, ...]
    rate_hz: float
    """Messages a second on each topic of a robot; 0: as many as go."""
    duration_s: float


class TrafficCount(Struct, frozen=True):
    """What a process has published and received, and how long [s] it published."""

    published: int
    received: int
    lasted_s: float


def main(task: TrafficTask) -> TrafficCount:
    """Publish and receive for the time of the task, once a line on standard input says so; return the counts."""
    inbox = _Counting()
    bus = ZenohBus(task.endpoint, inbox)
    bus.follow(frozenset(key(task.fleet, robot_name(robot), topic) for robot in task.hears for topic in HEARS))
    robots = [
        [(key(task.fleet, robot_name(robot), topic), size) for topic, size in SAYS.items()] for robot in task.says
    ]
    for to, _ in chain(*robots):
        bus.publish(to, b"")  # declares the publisher; an empty message counts as none
    clock.sleep(SETTLE_S)
    print("ready", flush=True)
    sys.stdin.readline()
    began, number = clock.now(), 0
    while clock.now() < began + task.duration_s:
        for place, keys in enumerate(robots):
            if task.rate_hz > 0.0:  # robots do not speak all at once
                clock.sleep(max(began + (number + place / len(robots)) / task.rate_hz - clock.now(), 0.0))
            for to, size in keys:
                bus.publish(to, bytes(size))
        number += 1
    lasted_s = clock.now() - began
    clock.sleep(SETTLE_S)
    bus.close()
    return TrafficCount(number * len(SAYS) * len(robots), inbox.received, lasted_s)


class _Counting(Inbox):
    """Inbox that counts messages and keeps nothing."""

    def __init__(self) -> None:
        super().__init__(size_max=INBOX_MAX, every=True)
        self.received = 0

    def put(self, arrival: Arrival) -> None:
        """Count an arrival, on any thread."""
        if isinstance(arrival.payload, bytes) and arrival.payload:
            self.received += 1


def start() -> None:
    """Carry out the task of the command line, and print the counts."""
    print(msgspec.json.encode(main(msgspec.json.decode(sys.argv[1], type=TrafficTask))).decode())
