"""A small world for leases alone: processes with clocks of their own, a faulty network, gateways, virtual time.

One heap of (true time, number, event). Everything random comes from one generator; two arenas with the same seed and
the same calls do the same. Messages pass through the codec when `encoded` is set. Directed tests and `lfa fuzz`
drive it; checkers listen through `watch`.
"""

from __future__ import annotations

from collections.abc import Callable
from heapq import heappop, heappush
from itertools import count
from random import Random

from msgspec import Struct

from protocol.geometry import Twist
from protocol.lease import AdoptChain, BecomeLeader, Effect, Lease, LeaseExtended, Send, StepDown
from protocol.gateway import Gateway
from protocol.messages import CmdVel, Fence, Header, LeaseBody, Member
from protocol.mission import WITNESS_ID, Mission, robot_id_of, robot_name
from protocol.timing import CONTROL_PERIOD_S, Timing, timing_of

FORWARD = Twist(0.5, 0.0)


class Clock(Struct, frozen=True):
    """local = offset + rate * true."""

    offset: float = 0.0
    rate: float = 1.0

    def local(self, true: float) -> float:
        return self.offset + self.rate * true

    def true(self, local: float) -> float:
        return (local - self.offset) / self.rate


class Weather(Struct):
    """What the network does to messages while the arena runs; times in seconds."""

    delay_min: float = 0.0003
    delay_max: float = 0.002
    loss: float = 0.0
    duplicate: float = 0.0
    tail: float = 0.0
    """Probability of an exponential delay of mean `tail_mean` on top."""
    tail_mean: float = 0.05
    hint_delay_max: float = 0.005


class Process(Struct):
    """One life of one robot's (or the witness's) lease."""

    id: int
    incarnation: int
    lease: Lease
    clock: Clock
    alive: bool = True
    paused: bool = False
    asleep: list[tuple[Member, LeaseBody]] = []
    timer: float = float("inf")
    """True time of the earliest wake-up already on the heap."""
    commands_from: float = float("-inf")

    @property
    def member(self) -> Member:
        return Member(self.id, self.incarnation)


class Watcher:
    """What a checker may listen to. All times are true times."""

    def effect(self, at: float, process: Process, effect: Effect) -> None: ...
    def sent(self, at: float, process: Process, to: str, body: LeaseBody) -> None: ...
    def command(self, at: float, gateway: Gateway, cmd: CmdVel, refused: str | None) -> None: ...
    def fault(self, at: float, kind: str, target: int) -> None: ...
