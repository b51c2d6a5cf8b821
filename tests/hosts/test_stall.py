"""Links that die together: with Zenoh's default threads they stall everybody's reception, with ours nobody's.

A tcp link that is closed while something is unsent blocks its receiver thread for 10 s (zenoh.md section 2).
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from lfa.protocol import clock
from lfa.protocol.geometry import Twist
from lfa.protocol.messages.codec import encode
from lfa.protocol.messages.consensus import NO_TERM, Role
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import PoseStamped
from lfa.protocol.topics import key
from lfa.protocol.transport.bus import Inbox
from lfa.protocol.transport.zenoh_bus import ZenohBus
from lfa.protocol.transport.zenoh_config import answers
from tests.hosts.conftest import Figure
from tests.rigs.network_namespaces import PORT, Net, missing

WHY_NOT = missing()
pytestmark = [pytest.mark.hosts, pytest.mark.skipif(WHY_NOT is not None, reason=str(WHY_NOT))]

HUB, HEALTHY, DYING = 0, 1, range(2, 8)
PERIOD_S = 0.02
STALL_S_MIN = 5.0
"""One pair of dead links holds reception for 10 s."""
UNTOUCHED_S = 0.3
START_S = 20.0
DEFAULT_THREADS = {"ZENOH_RUNTIME": "(rx: (worker_threads: 2))"}


class Star:
    """A router in the middle, one healthy machine and six that will die; everybody hears the healthy one's poses."""

    def __init__(self, net: Net, folder: Path) -> None:
        self._net = net
        self._folder = folder
        self._children: list[subprocess.Popen[bytes]] = []
        self._buses: list[ZenohBus] = []
        self._inbox = Inbox(every=True)

    def open(self, environment: Mapping[str, str]) -> None:
        for host in self._net.hosts:
            words = ["--listen", self._socket(host), "--listen", f"tcp/{self._net.address(host)}:{PORT}"]
            words += [] if host == HUB else ["--connect", f"tcp/{self._net.address(HUB)}:{PORT}"]
            command = [*self._net.enter(host), sys.executable, "-m", "lfa.deploy.fleet.host.router", *words]
            self._children.append(subprocess.Popen(command, env={**os.environ, **environment}))
        until = clock.now() + START_S
        while not all(answers(self._socket(host)) for host in self._net.hosts):
            assert clock.now() < until, "the routers do not answer"
        for host in self._net.hosts:
            bus = ZenohBus(self._socket(host), self._inbox if host == HUB else Inbox())
            bus.follow(frozenset({key("stall", "robot1", "pose")}))
            self._buses.append(bus)

    def close(self) -> None:
        for bus in self._buses:
            bus.close()
        for child in self._children:
            child.kill()
            child.wait()

    def silence(self, duration_s: float) -> float:
        """Publish poses at the healthy machine for so long; the longest time that none came to the middle."""
        began = last = clock.now()
        longest, seq = 0.0, 0
        while clock.now() < began + duration_s:
            seq += 1
            header = Header("robot1", 1, seq, clock.now())
            pose = PoseStamped(header, 0.0, 0.0, 0.0, 0.0, Twist(0.0, 0.0), 0.0, Role.LEADER, NO_TERM)
            self._buses[HEALTHY].publish(key("stall", "robot1", "pose"), encode(pose))
            clock.sleep(PERIOD_S)
            for arrival in self._inbox.take():
                longest, last = max(longest, arrival.at - last), arrival.at
        return max(longest, clock.now() - last)

    def kill_links(self) -> None:
        for host in DYING:
            self._net.unplug(host)

    def _socket(self, host: int) -> str:
        return f"unixsock-stream/{self._folder / f'{host}.sock'}"


@contextmanager
def star(environment: Mapping[str, str]) -> Iterator[Star]:
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="lfa-", dir="/tmp")))
        made = Star(stack.enter_context(Net(len(DYING) + 2)), folder)
        stack.callback(made.close)
        made.open(environment)
        made.silence(1.0)
        yield made


@pytest.mark.long
def test_with_the_default_threads_six_links_that_die_at_once_stall_the_healthy_ones() -> None:
    """What is to be shown gone below: were this to pass no more, neither would that mean anything."""
    with star(DEFAULT_THREADS) as hub:
        hub.kill_links()
        assert hub.silence(14.0) >= STALL_S_MIN


def test_six_links_that_die_at_once_are_nobody_elses_silence(figure: Figure) -> None:
    with star({}) as hub:
        alone = hub.silence(2.0)
        hub.kill_links()
        silence_s = hub.silence(6.0)
    figure("6 links dead at once: longest silence of a healthy robot", silence_s, UNTOUCHED_S, alone)
    assert silence_s < STALL_S_MIN
