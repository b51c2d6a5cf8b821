"""Rows of `lfa bench router`: one router between processes that carry the traffic of robots and compute nothing.

What the routers of a federation carry is counted in the simulator, beside what the formula of
deploy/docs/performance.md says, and taken times the measured cost of a message.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from functools import cache, partial
from pathlib import Path
from statistics import mean

import msgspec
from msgspec import Struct

from lfa.deploy.bench.harness.child_process import cpu_s, started
from lfa.deploy.bench.harness.rows import Case, Quantity, measured, select, show
from lfa.deploy.bench.router import traffic
from lfa.deploy.bench.router.federation import HEAD, Federation, predicted, simulated
from lfa.deploy.bench.router.traffic import TrafficCount, TrafficTask
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.transport.zenoh_config import answers

ROBOTS, ROBOTS_FULL = 100, 200
RATE_HZ = 20.0
PROCESSES = 4
"""Processes among which the robots are divided; each robot is heard in another process than its own."""
DURATION_S = 10.0
PROGRAM = f"from {traffic.__name__} import start; start()"
READY_S_MAX = 20.0
FEDERATIONS = (Federation(100, 4), Federation(200, 10))
FEDERATIONS_FULL = (*FEDERATIONS, Federation(1000, 20))


class RouterLoad(Struct, frozen=True):
    """Traffic of all processes together, and the router's processor time [s] meanwhile."""

    counts: tuple[TrafficCount, ...]
    cpu_s: float

    @property
    def received(self) -> int:
        return sum(count.received for count in self.counts)

    @property
    def lasted_s(self) -> float:
        return max(count.lasted_s for count in self.counts)


def run(as_json: bool, rows: str = "*", full: bool = False) -> int:
    """Print the rows; return 0 if all hold, else 1. `full`: 200 robots, and a federation of 1000, too."""
    return show(measured(select(cases(full), rows), 1, rows), as_json)


def cases(full: bool) -> list[Case]:
    """Return the loads to measure."""
    usual = [_case(robots) for robots in (ROBOTS, *((ROBOTS_FULL,) if full else ()))]
    flood = Case("as many as go", (Quantity("messages", "1/s"), Quantity("router, per message", "us")), _flood)
    return [*usual, flood, *map(_federation_case, FEDERATIONS_FULL if full else FEDERATIONS)]


def _case(robots: int) -> Case:
    quantities = (
        Quantity("delivered", "%", 100.0, "at least"),
        Quantity("messages through the router", "1/s"),
        Quantity("router, share of a core", "%"),
        Quantity("router, per message", "us"),
    )
    return Case(f"{robots} robots at {RATE_HZ:g} Hz", quantities, partial(_robots, robots))


def _federation_case(federation: Federation) -> Case:
    head_hz, other_hz = predicted(federation)
    quantities = (
        Quantity("leader's router, messages passed on", "1/s", head_hz, "near"),
        Quantity("another router, messages passed on", "1/s", other_hz, "near"),
        Quantity("leader's router, share of a core", "%"),
        Quantity("another router, share of a core", "%"),
    )
    name = f"federation/{federation.robots} robots on {federation.machines} machines"
    return Case(name, quantities, partial(_federation, federation))


def _federation(federation: Federation) -> list[float]:
    routers, duration_s = simulated(federation)
    each_hz = [router.passed_on / duration_s for router in routers]
    head_hz, other_hz = each_hz[HEAD], mean(hz for place, hz in enumerate(each_hz) if place != HEAD)
    percent = 100.0 * 1e-6 * _each_us(_load(ROBOTS))
    return [head_hz, other_hz, percent * head_hz, percent * other_hz]


def _robots(robots: int) -> list[float]:
    load = _load(robots)
    heard = len(traffic.HEARS) / len(traffic.SAYS)
    published = sum(count.published for count in load.counts) * heard
    percent = 100.0 * load.cpu_s / load.lasted_s
    return [100.0 * load.received / published, load.received / load.lasted_s, percent, _each_us(load)]


@cache
def _load(robots: int) -> RouterLoad:
    """Measure the usual load of so many robots; once, for all rows that need it."""
    return _measure(robots, PROCESSES, RATE_HZ)


def _flood() -> list[float]:
    load = _measure(2, 2, 0.0)
    return [load.received / load.lasted_s, _each_us(load)]


def _each_us(load: RouterLoad) -> float:
    return 1e6 * load.cpu_s / max(load.received, 1)


def _measure(robots: int, processes: int, rate_hz: float) -> RouterLoad:
    """Run the traffic of so many robots through one router. Raises Refused if a process fails."""
    with tempfile.TemporaryDirectory(prefix="lfa-") as folder:
        endpoint = f"unixsock-stream/{Path(folder) / 'router.sock'}"
        with started((sys.executable, "-m", "lfa.deploy.fleet.host.router", "--listen", endpoint)) as router:
            until = clock.now() + READY_S_MAX
            while not answers(endpoint):
                if clock.now() > until:
                    raise Refused(f"the router was not ready within {READY_S_MAX:g} s")
                clock.sleep(0.05)
            before_s = cpu_s(router)
            counts = _traffic(_tasks(endpoint, robots, processes, rate_hz))
            return RouterLoad(counts, cpu_s(router) - before_s)


def _tasks(endpoint: str, robots: int, processes: int, rate_hz: float) -> list[TrafficTask]:
    """Return the tasks: robot n is published by process n mod `processes`, and heard by the next process."""
    parts = [tuple(range(1 + part, robots + 1, processes)) for part in range(processes)]
    return [
        TrafficTask(endpoint, "bench", says, parts[part - 1], rate_hz, DURATION_S) for part, says in enumerate(parts)
    ]


def _traffic(tasks: Sequence[TrafficTask]) -> tuple[TrafficCount, ...]:
    """Run a process for each task, and return their counts. Raises Refused if one fails."""
    words = [(sys.executable, "-c", PROGRAM, msgspec.json.encode(task).decode()) for task in tasks]
    children = [subprocess.Popen(one, stdout=subprocess.PIPE, stdin=subprocess.PIPE) for one in words]
    try:
        for child in children:
            assert child.stdout is not None
            child.stdout.readline()  # it is ready, or has failed
        for child in children:
            assert child.stdin is not None
            with suppress(BrokenPipeError):
                child.stdin.write(b"go\n")
                child.stdin.flush()
        said = [child.communicate()[0] for child in children]
    finally:
        for child in children:
            child.kill()
            child.wait()
    if any(child.returncode for child in children):
        raise Refused("a process of the bench has failed: see above")
    return tuple(msgspec.json.decode(line, type=TrafficCount) for line in said)
