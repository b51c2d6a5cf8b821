"""Observer session at one router: longest silence in each robot's stream of poses, and the present chain."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from lfa.deploy.client.session import FleetAddress, Subscriber, listen
from lfa.deploy.fleet.health import Health
from lfa.deploy.fleet.plan.host_plan import KEYS
from lfa.protocol import clock
from lfa.protocol.messages.team import Event, PoseStamped
from lfa.protocol.names import robot_id_of
from lfa.protocol.topics import HOST_PREFIX
from lfa.protocol.transport.zenoh_config import answers
from tests.rigs.lfa_runs import eventually
from tests.rigs.machines import Machines

POLL_S = 0.005
TOPICS = frozenset({"*/pose", "*/tracking", "*/host", "*/event", "*/status"})


class Onlooker:
    """Poses as they arrive, with the longest silence of each robot since `begin`."""

    def __init__(self, subscriber: Subscriber, robots: tuple[int, ...], keep: Callable[[], Path]) -> None:
        """`keep` stores what explains a failure, and returns its folder."""
        self._subscriber = subscriber
        self._keep = keep
        self.robots = robots
        self.health = Health(robots, ())
        self.events: list[Event] = []
        self._last: dict[int, float] = {}
        self._gaps: dict[int, float] = {}

    def listen(self) -> None:
        for arrival, message in self._subscriber.take():
            self.health.see(arrival.at, message)
            robot = robot_id_of(message.header.sender)
            if isinstance(message, PoseStamped) and robot is not None:
                self._gaps[robot] = max(self._gaps.get(robot, 0.0), arrival.at - self._last.get(robot, arrival.at))
                self._last[robot] = arrival.at
            elif isinstance(message, Event):
                self.events.append(message)

    def begin(self) -> None:
        """Discard earlier gaps and events, and start to measure."""
        self.listen()
        self._gaps.clear()
        self.events.clear()

    def gaps(self) -> dict[int, float]:
        """Return the longest silence [s] of each robot since `begin`, including the present one."""
        now = clock.now()
        return {
            robot: max(self._gaps.get(robot, 0.0), now - self._last.get(robot, float("-inf"))) for robot in self.robots
        }

    def watch(self, duration_s: float) -> None:
        until = clock.now() + duration_s
        self.wait(lambda: clock.now() >= until, "the clock stands", duration_s + 5.0)

    def wait(self, holds: Callable[[], bool], complaint: str, within_s: float) -> None:
        until = clock.now() + within_s
        while True:
            self.listen()
            if holds():
                return
            if clock.now() > until:
                pytest.fail(f"{complaint} within {within_s:g} s: {self._explanation(clock.now())}")
            clock.sleep(POLL_S)

    def _explanation(self, now: float) -> str:
        """Return what each robot says of itself; a leader also says who is there and not in its chain (E27)."""
        texts = "".join(f"\n  {name}: {text}" for name, text in sorted(self.health.texts.items()))
        gaps = {robot: round(gap, 2) for robot, gap in self.gaps().items()}
        return f"chain {self.health.chain(now)}, gaps {gaps}{texts}\n  journals and logs of all hosts: {self._keep()}"

    def chain(self) -> tuple[int, ...]:
        return self.health.chain(clock.now())

    def whole(self, robots: set[int]) -> bool:
        return set(self.chain()) == robots


@contextmanager
def onlooker(machines: Machines, at: str, robots: tuple[int, ...]) -> Iterator[Onlooker]:
    """Open an observer session at machine `at`'s router over its unix socket, without a network in between.

    `at` may name several machines: when the router of one is lost, the session goes over to the next.
    """
    part = machines.part(at[0])
    eventually(lambda: answers(part.socket, part.known_as(f"{HOST_PREFIX}{at[0]}")), f"no router answers at {at[0]}")
    sockets = ",".join(machines.part(name).socket for name in at)
    keys = part.folder / KEYS if part.secure else None
    with listen(FleetAddress(part.fleet, sockets, (), keys), TOPICS, every=True) as subscriber:
        yield Onlooker(subscriber, robots, machines.keep)
