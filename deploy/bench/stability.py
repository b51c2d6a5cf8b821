"""`lfa bench stability`: lease holder changes without a fault, on a busy machine and at a packet loss of 20 %.

Two of the three cases run real processes in real time; the third runs the same agents in virtual time.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from fnmatch import fnmatchcase

from lfa.agents.agent import Agent
from lfa.deploy.bench.harness.rows import BenchRow, Quantity, row, show
from lfa.deploy.bench.harness.team import Broken, Team, endless
from lfa.protocol import clock
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.team import Event
from lfa.protocol.node import Node
from lfa.protocol.runtime.journal import JOURNAL_VERSION, Heading, Journal
from lfa.protocol.transport.link_model import LINK_CONDITIONS, Radio
from lfa.protocol.witness import Witness
from lfa.world.description.load import Scenario
from lfa.world.physics.kinematics import Kinematic
from lfa.world.simulator import Simulator
from lfa.world.world import World

ROBOTS = 4
MINUTES = 10.0
BUSY_CORES = 2
LOSS = 0.2
WARM_UP_S = 5.0
LOOK_S = 0.05
START_S = 60.0
"""Maximum time [s] until the chain is complete, at a high packet loss."""
BUSY = "import os\nwhile os.getppid() == {parent}:\n    sum(range(20000))"


class Watch:
    """Counters of leader changes and chain changes, from the accepted leader commands and the chain events."""

    def __init__(self) -> None:
        self.holder_changes = 0
        self.chain_changes = 0
        self._holder: int | None = None
        self._chain: list[int] | None = None
        self._version: tuple[object, ...] = ()

    def see(self, event: Event) -> None:
        """Update the counters with an event; a chain event counts only if its version is newer than the last."""
        match event.kind:
            case "leader_command":
                robot = event.data["robot"]
                self.holder_changes += self._holder not in (None, robot)
                self._holder = robot
            case "chain" if event.term is not None:
                version = (event.term, event.data["seq"])
                if not self._version or version > self._version:
                    self.chain_changes += self._chain not in (None, event.data["chain"])
                    self._chain, self._version = event.data["chain"], version


def run(as_json: bool, rows: str = "*", minutes: float = MINUTES) -> int:
    """Print the rows; return 0 if the lease holder never changed. The run takes a little more than twice `minutes`."""
    return show(_rows(rows, 60.0 * minutes), as_json)


def _rows(glob: str, duration_s: float) -> Iterator[list[BenchRow]]:
    if fnmatchcase("busy", glob.split("/")[0]):
        with _busy(BUSY_CORES):
            yield _counted(f"busy, std, {ROBOTS} processes", duration_s, _live(endless(ROBOTS), duration_s, loss=0.0))
    if fnmatchcase("loss", glob.split("/")[0]):
        yield _counted(f"loss {LOSS:g}, std, simulated", duration_s, _simulated(endless(ROBOTS), duration_s))
        wifi = endless(ROBOTS, "wifi")
        yield _counted(f"loss {LOSS:g}, wifi, {ROBOTS} processes", duration_s, _live(wifi, duration_s, loss=LOSS))


def _counted(name: str, duration_s: float, watch: Watch) -> list[BenchRow]:
    minutes = duration_s / 60.0
    return [
        row(name, Quantity(f"holder changes in {minutes:g} min", "times", 0.0), float(watch.holder_changes)),
        row(name, Quantity("chain changes a minute", "1/min"), watch.chain_changes / minutes),
    ]


def _live(scenario: Scenario, duration_s: float, loss: float) -> Watch:
    watch = Watch()
    with Team(scenario) as team:
        team.await_chain(ROBOTS, START_S)
        if loss > 0.0:
            team.order(LINK_CONDITIONS, radio={"loss": loss})
        _look_on(team, WARM_UP_S)
        team.heard.events.clear()
        until = clock.now() + duration_s
        while clock.now() < until:
            _look_on(team, LOOK_S)
            for event in team.heard.events:
                watch.see(event)
            team.heard.events.clear()
        if not team.chain() and loss == 0.0:
            raise Broken(f"the chain is not whole at the end: {team.heard.describe(clock.now())}")
    return watch


def _look_on(team: Team, for_s: float) -> None:
    until = clock.now() + for_s
    while clock.now() < until:
        team.listen()
        clock.sleep(LOOK_S)


def _simulated(scenario: Scenario, duration_s: float) -> Watch:
    """Run agents in virtual time, on kinematic bodies without a physics engine; return the counters."""
    watch, since = Watch(), WARM_UP_S
    simulator = Simulator(Radio(loss=LOSS), seed=1)

    def hear(now: float, _key: str, _payload: bytes, message: Message) -> None:
        if now >= since and isinstance(message, Event):
            watch.see(message)

    simulator.taps.append(hear)
    world = World("bench", scenario, 1, 1, start_at=0.0, bodies=Kinematic)
    agents = [Agent(robot, 1, "bench", 1) for robot in scenario.mission.robots]
    nodes: list[Node] = [world, Witness("bench", 1, 1), *agents]
    for node in nodes:
        simulator.add(node, Journal(None, Heading(JOURNAL_VERSION, node.name, 1, 1, {})))
    simulator.run(since + duration_s)
    return watch


@contextmanager
def _busy(cores: int) -> Iterator[None]:
    """Run `cores` processes that only compute; each ends when this process ends, also after a SIGKILL."""
    command = [sys.executable, "-c", BUSY.format(parent=os.getpid())]
    burners = [subprocess.Popen(command) for _ in range(cores)]
    try:
        yield
    finally:
        for burner in burners:
            burner.kill()
            burner.wait()
