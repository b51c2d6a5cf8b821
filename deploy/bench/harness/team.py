"""Team of real processes that a bench or a test keeps running, with fault injection and received messages.

What is heard of it lies in `team_history.py`.
"""

from __future__ import annotations

import shutil
import signal
import tempfile
from collections.abc import Callable, Sequence
from math import cos, pi, sin
from pathlib import Path
from types import TracebackType
from typing import Any

from lfa.deploy.analysis.verification.journals import JournalVerdict, verify
from lfa.deploy.bench.harness.team_history import TeamHistory
from lfa.deploy.client.operator import Operator
from lfa.deploy.client.session import FleetAddress
from lfa.deploy.process.identity import Identity
from lfa.deploy.process.process_group import ROUTER_NAME, ProcessGroup, ProcessSpec
from lfa.deploy.recording.run_folder import About, make
from lfa.deploy.run.process_table import rows
from lfa.protocol import clock, incarnations
from lfa.protocol.mission import FormationSpec, Leading, Mission, Profile
from lfa.protocol.names import robot_name
from lfa.protocol.topics import RECORDER_NAME, WORLD_NAME, key
from lfa.protocol.transport.bus import Inbox
from lfa.protocol.transport.credentials import Credentials
from lfa.protocol.transport.link_model import LINK_CONDITIONS
from lfa.protocol.transport.message_bus import Decoder, send
from lfa.protocol.transport.zenoh_bus import ZenohBus
from lfa.protocol.transport.zenoh_config import answers
from lfa.world.description.load import Scenario

POLL_S = 0.001
START_S_MAX = 20.0
SETTLED_S = 0.5
ANEW_S = 3.0
"""Period [s] of renewing subscriptions; routers may lose them when their link was down (`ZenohBus.resubscribe`)."""
TOPICS = ("event", "tracking", "pose", "truth", "status")
Table = Callable[[Sequence[ProcessSpec], Path], Sequence[ProcessSpec]]


class Broken(Exception):
    """Error: the team did not reach the awaited state, or a process is missing."""


def endless(robots: int, profile: Profile = "std", laps: int = 3) -> Scenario:
    """Return a scenario of slow laps on a circle, some 30 min, with room for a robot that returns to the tail.

    The route begins where the team does: only a leader that is killed before its first way-point costs the next one the
    time to lay the route anew.
    """
    radius_m, corners = 10.0, 16
    turns = (2.0 * pi * n / corners for n in range(corners * laps - corners // 2))
    route_m = tuple((radius_m * sin(turn), radius_m * (1.0 - cos(turn))) for turn in turns)
    leading = Leading(route_m=route_m, cruise_mps=0.1)
    formation = FormationSpec(separation_m=3.0)
    mission = Mission(tuple(range(1, robots + 1)), profile=profile, formation=formation, leading=leading)
    return Scenario("A bench's endless course", mission, 1e6, name="endless")


def _name(whom: int | str) -> str:
    return robot_name(whom) if isinstance(whom, int) else whom


class Team:
    """Router, world and agents of `scenario`; at the end of the block all processes and files are removed."""

    def __init__(
        self,
        scenario: Scenario,
        table: Table | None = None,
        credentials: Credentials | None = None,
        fleet: str | None = None,
    ) -> None:
        """Prepare the run folder and the process table; nothing is started yet.

        `table` maps the usual rows and the folder of sockets to the rows to start; the recorder is never started.
        `credentials` are those of the observer session for a router with access control, whose rules name `fleet`.
        """
        self.scenario = scenario
        self.folder = Path(tempfile.mkdtemp(prefix="lfa-"))
        run = make(self.folder / "run", scenario)
        self._endpoint = f"unixsock-stream/{self.folder / 'router.sock'}"
        self._credentials = credentials
        self._about = About(scenario.name, "processes", 0, fleet or f"bench{clock.wall_ms()}")
        usual = rows(run, self._about, self._endpoint, scenario, "")
        self._rows = {row.name: row for row in (usual if table is None else table(usual, self.folder))}
        self._processes = ProcessGroup(run)
        self._inbox = Inbox(every=True)
        self._decoder = Decoder()
        self._bus: ZenohBus | None = None
        self._operator = Operator(self._about.fleet, incarnations.drawn())
        self.heard = TeamHistory(scenario.mission.robots)

    def __enter__(self) -> Team:
        try:
            self._processes.start(self._rows[ROUTER_NAME])
            self.wait_until(lambda: answers(self._endpoint, self._credentials), "the router does not answer")
            self._bus = ZenohBus(self._endpoint, self._inbox, credentials=self._credentials)
            self._bus.follow(frozenset(key(self._about.fleet, "*", topic) for topic in TOPICS))
            for name, row in self._rows.items():
                if name not in (ROUTER_NAME, RECORDER_NAME):
                    self._processes.start(row)
        except BaseException:
            self._end()
            raise
        return self

    def __exit__(self, _t: type[BaseException] | None, _e: BaseException | None, _tb: TracebackType | None) -> None:
        self._end()

    def _end(self) -> None:
        if self._bus is not None:
            self._bus.close()
        self._processes.kill_all()
        shutil.rmtree(self.folder, ignore_errors=True)

    def judged(self) -> JournalVerdict:
        """End all processes, then check the journals of all incarnations and return the verdict.

        Journals read one after the other while they grow would be inconsistent: one read late may contain a PROPOSE
        whose promises are missing in one read early.
        """
        self._processes.kill_all()
        return verify(self.folder / "run")

    @property
    def fleet(self) -> FleetAddress:
        """Address of the fleet for observer sessions."""
        return FleetAddress(self._about.fleet, self._endpoint, ())

    # --- what can be done to it ------------------------------------------------------------------------------------

    def signal(self, whom: int | str, number: signal.Signals) -> float:
        """Signal an agent by robot id or a process by name; return the time [s] just before. Raises Broken."""
        at, name = clock.now(), _name(whom)
        if not self._processes.signal(name, number):
            raise Broken(f"{name} is not there to be signalled")
        return at

    def process_of(self, name: str) -> Identity:
        """Return the identity of the process `name`. Raises Broken if it does not run."""
        identity = self._processes.identity(name)
        if identity is None:
            raise Broken(f"{name} does not run")
        return identity

    def restart(self, *ended: int | str) -> None:
        """Restart processes that have ended: agents with empty memory, a world from its saved state. Raises Broken."""
        for whom in ended:
            name = _name(whom)
            if not self._processes.wait([name], START_S_MAX):
                raise Broken(f"{name} does not end")
            if isinstance(whom, int):
                self.heard.state.forget(whom)
            self._processes.start(self._rows[name].restarted())

    def start(self, row: ProcessSpec) -> None:
        self._processes.start(row)

    def row(self, name: str) -> ProcessSpec:
        return self._rows[name]

    def order(self, command: str, **arguments: Any) -> float:
        """Publish an operator command to all; return the time [s] just before."""
        assert self._bus is not None
        at = clock.now()
        send(self._bus, self._operator.command(command, at, **arguments))
        return at

    def cut_off(self, *robots: int) -> float:
        """Block all messages between `robots` and the others, world included; return the time [s] just before."""
        inside = [robot_name(robot) for robot in robots]
        outside = [robot_name(r) for r in self.scenario.mission.robots if r not in robots] + [WORLD_NAME]
        pairs = [pair for a in inside for b in outside for pair in ((a, b), (b, a))]
        return self.order(LINK_CONDITIONS, cut=pairs)

    def heal(self) -> float:
        """Heal the partition; return the time [s] just before."""
        return self.order(LINK_CONDITIONS, heal=True)

    # --- what is heard of it ---------------------------------------------------------------------------------------

    def listen(self) -> None:
        """Receive all pending messages and update the state of the team."""
        self.heard.take(message for _, message in self._decoder.messages(self._inbox.take()))

    def wait_until(self, holds: Callable[[], bool], complaint: str, within_s: float = START_S_MAX) -> None:
        """Receive messages until `holds()` is true. Raises Broken with `complaint` after `within_s`."""
        until = clock.now() + within_s
        while True:
            self.listen()
            if holds():
                return
            if clock.now() > until:
                raise Broken(f"{complaint} within {within_s:g} s")
            clock.sleep(POLL_S)

    def chain(self) -> tuple[int, ...]:
        """Return the chain on which all present robots agree; empty if they disagree or a member is absent."""
        return self.heard.chain(clock.now())

    def await_chain(self, length: int, within_s: float = START_S_MAX) -> tuple[int, ...]:
        """Wait until one chain of `length` robots has been stable for `SETTLED_S`, and return it. Raises Broken."""
        since = clock.now()
        anew_at = since + ANEW_S
        last: tuple[int, ...] = ()

        def settled() -> bool:
            nonlocal since, last, anew_at
            chain, now = self.chain(), clock.now()
            if now > anew_at and self._bus is not None:
                anew_at = now + ANEW_S
                self._bus.resubscribe()
            if chain != last or len(chain) != length:
                since, last = now, chain
            return now - since >= SETTLED_S

        try:
            self.wait_until(settled, f"no settled chain of {length}", within_s)
        except Broken as broken:
            raise Broken(f"{broken}: {self.heard.describe(clock.now())}") from None
        return last
