"""Rows of `lfa bench soak`: a team under drawn faults, with memory, threads and descriptors of its lasting processes.

Some robots are killed and restarted again and again; the others are only stopped, cut off and heard badly, so that
they and world and router live through all of it. The journals of all incarnations are checked at the end.
"""

from __future__ import annotations

import os
import signal
import statistics
import sys
from collections.abc import Callable, Iterator, Sequence
from math import nan
from random import Random

from msgspec import Struct

from lfa.deploy.bench.agents.footprint import footprint
from lfa.deploy.bench.harness.rows import BenchRow, Quantity, row, show
from lfa.deploy.bench.harness.team import Broken, Team, endless
from lfa.deploy.process.process_group import ROUTER_NAME
from lfa.protocol import clock
from lfa.protocol.names import robot_name
from lfa.protocol.topics import WORLD_NAME
from lfa.protocol.transport.link_model import LINK_CONDITIONS

ROBOTS = 8
MORTAL = (1, 2, 3, 4)
"""Robots that are killed; the others live as long as the team."""
LASTING = (ROUTER_NAME, WORLD_NAME, *(robot_name(robot) for robot in range(len(MORTAL) + 1, ROBOTS + 1)))
MINUTES = 30.0
GROWTH_MAX = 2.0
"""Largest growth [%] of what a process holds."""
WARM_UP = 0.2
"""Share of the time after which the first footprint is taken: caches and buffers are full by then."""
EVERY_S = 3.0
SAMPLE_S = 1.0
FROZEN_S = 0.6
"""Duration [s] of a stop or cut: long enough to lose a lease, shorter than the lease of a link."""
LAPS = 12
AGREED_S_MAX = 60.0
SEED = "soak"


class Holding(Struct, frozen=True):
    """What one process holds at one moment."""

    memory_mib: float
    threads: float
    descriptors: float


class SoakedTeam:
    """Team with drawn faults: `step` does the next one; `samples` has what each lasting process held, in time."""

    def __init__(self, team: Team) -> None:
        self._team = team
        self._random = Random(SEED)
        self.faults = 0
        self.not_back = 0
        """Times that a chain of all robots was not there again in time."""
        self.samples: dict[str, list[Holding]] = {name: [] for name in LASTING}

    def sample(self) -> None:
        """Take down what each lasting process holds."""
        for name in LASTING:
            self.samples[name].append(holding(self._team.process_of(name).pid))

    def step(self) -> None:
        """Inject a drawn fault, and undo it."""
        faults: tuple[Callable[[], None], ...] = (self._kill, self._stop, self._cut, self._lose)
        self._random.choice(faults)()
        self.faults += 1

    def rest(self, duration_s: float) -> None:
        until = clock.now() + duration_s
        self._team.wait_until(lambda: clock.now() >= until, "the clock stands", duration_s + AGREED_S_MAX)

    def await_all(self) -> None:
        """Wait for the chain of all robots."""
        try:
            self._team.await_chain(ROBOTS, AGREED_S_MAX)
        except Broken as broken:
            print(f"not back: {broken}", file=sys.stderr, flush=True)
            self.not_back += 1

    def _kill(self) -> None:
        victim = self._random.choice(MORTAL)
        self._team.signal(victim, signal.SIGKILL)
        self.rest(self._random.choice((0.0, 0.2, 1.0)))
        self._team.restart(victim)

    def _stop(self) -> None:
        victim = self._random.randint(1, ROBOTS)
        self._team.signal(victim, signal.SIGSTOP)
        self.rest(FROZEN_S)
        self._team.signal(victim, signal.SIGCONT)

    def _cut(self) -> None:
        self._team.cut_off(*self._random.sample(range(1, ROBOTS + 1), 2))
        self.rest(FROZEN_S)
        self._team.heal()

    def _lose(self) -> None:
        self._team.order(LINK_CONDITIONS, radio={"loss": 0.2})
        self.rest(FROZEN_S)
        self._team.heal()


def run(as_json: bool, minutes: float = MINUTES) -> int:
    """Print the rows; return 0 if all hold, else 1. Faults are injected for `minutes`."""
    return show(_rows(60.0 * minutes), as_json)


def _rows(duration_s: float) -> Iterator[list[BenchRow]]:
    with Team(endless(ROBOTS, laps=LAPS)) as team:
        team.await_chain(ROBOTS, AGREED_S_MAX)
        soaked, began = SoakedTeam(team), clock.now()
        while clock.now() < began + duration_s:
            if clock.now() >= began + WARM_UP * duration_s:
                soaked.sample()
            soaked.step()
            soaked.rest(min(EVERY_S, 0.1 * duration_s))
        soaked.await_all()
        for _ in range(3):
            soaked.rest(min(SAMPLE_S, 0.02 * duration_s))
            soaked.sample()
        verdict = team.judged()
    for broken in verdict.broken:
        print(f"{broken.name} at {broken.at:.3f} s: {broken.text}", file=sys.stderr, flush=True)
    quantities = (("unique memory", _memory), ("threads", _threads), ("descriptors", _descriptors))
    yield [
        *(
            row("growth", Quantity(f"of {what}, the largest", "%", GROWTH_MAX), _largest(soaked.samples, of))
            for what, of in quantities
        ),
        row("soak", Quantity("faults", "times"), float(soaked.faults)),
        row("soak", Quantity("whole chain not back", "times", 0.0), float(soaked.not_back)),
        row("soak", Quantity("violations", "times", 0.0), float(len(verdict.broken))),
    ]


def _largest(samples: dict[str, list[Holding]], of: Callable[[Holding], float]) -> float:
    """Return the largest growth [%] of a process, and say on standard error whose it is."""
    grown = {name: growth([of(one) for one in some]) for name, some in samples.items()}
    name = max(grown, key=lambda one: grown[one])
    print(f"{name}: {grown[name]:.2f} %", file=sys.stderr, flush=True)
    return grown[name]


def growth(values: Sequence[float]) -> float:
    """Return how much [%] the last fifth of `values` lies above the first, by their medians; not a number if empty."""
    if not values:
        return nan
    part = max(1, len(values) // 5)
    before, after = statistics.median(values[:part]), statistics.median(values[-part:])
    return 100.0 * (after - before) / before


def holding(pid: int) -> Holding:
    """Return what the process `pid` holds. Raises OSError if there is none or it is another user's."""
    memory = footprint(pid)
    return Holding(memory.unique_mib, float(memory.threads), float(len(os.listdir(f"/proc/{pid}/fd"))))


def _memory(one: Holding) -> float:
    return one.memory_mib


def _threads(one: Holding) -> float:
    return one.threads


def _descriptors(one: Holding) -> float:
    return one.descriptors
