"""Team of real processes that a bench or a test keeps running, with fault injection and received messages.

All processes of one machine read one clock (`lfa.protocol.clock`), and every header carries a stamp of the sender's
clock. So only here may stamps of different processes be subtracted.
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

from msgspec import structs

from lfa.deploy.analysis.verification.journals import JournalVerdict, verify
from lfa.deploy.client.operator import Operator
from lfa.deploy.client.session import FleetAddress
from lfa.deploy.process.identity import Identity
from lfa.deploy.process.process_group import ROUTER_NAME, ProcessGroup, ProcessSpec
from lfa.deploy.recording.run_folder import About, make
from lfa.deploy.run.process_table import rows
from lfa.protocol import clock
from lfa.protocol.messages.codec import BadMessage, Message, decode, encode
from lfa.protocol.messages.consensus import Role
from lfa.protocol.messages.simulation import Truth
from lfa.protocol.messages.team import Event, PoseStamped, Status, Tracking
from lfa.protocol.mission import FormationSpec, Leading, Mission, Profile
from lfa.protocol.names import robot_id_of, robot_name
from lfa.protocol.topics import RECORDER_NAME, TOPIC, WORLD_NAME, address, key
from lfa.protocol.transport.bus import Inbox
from lfa.protocol.transport.credentials import Credentials
from lfa.protocol.transport.link_model import WEATHER
from lfa.protocol.transport.zenoh_bus import ZenohBus
from lfa.protocol.transport.zenoh_config import answers
from lfa.world.description.load import Scenario

POLL_S = 0.001
START_S_MAX = 20.0
SPEAKING_S = 0.15
"""Time [s] without a pose after which a robot counts as absent."""
SETTLED_S = 0.5
REST_MPS = 1e-3
"""Maximum speed [m/s] of a robot at rest."""
ANEW_S = 3.0
"""Period [s] of renewing subscriptions; routers may lose them when their link was down (`ZenohBus.resubscribe`)."""
EVENTS_MAX = 4096
TOPICS = ("event", "tracking", "pose", "truth", "status")
Table = Callable[[Sequence[ProcessSpec], Path], Sequence[ProcessSpec]]


class Broken(Exception):
    """Error: the team did not reach the awaited state, or a process is missing."""


def endless(robots: int, profile: Profile = "std", laps: int = 3) -> Scenario:
    """Return a scenario of slow laps on a circle, some 30 min, with room for a robot that returns to the tail."""
    radius_m, corners = 10.0, 16
    turns = (2.0 * pi * n / corners for n in range(1, corners * laps - corners // 2))
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
        usual = rows(run, self._about, self._endpoint, scenario.mission, "")
        self._rows = {row.name: row for row in (usual if table is None else table(usual, self.folder))}
        self._processes = ProcessGroup(run)
        self._inbox = Inbox(every=True)
        self._bus: ZenohBus | None = None
        self._operator = Operator(self._about.fleet, clock.wall_ms())
        self.events: list[Event] = []
        self.tracking: list[Tracking] = []
        self.speeds_mps: dict[int, float] = {}
        """True speed [m/s] of each robot in the world's last message."""
        self.moved_at: dict[int, float] = {}
        """Time [s] of the last motion of each robot, by the world's stamp."""
        self._poses: dict[int, PoseStamped] = {}
        self._chains: dict[int, tuple[tuple[Any, ...], tuple[int, ...]]] = {}

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
                self._poses.pop(whom, None)  # messages of the earlier incarnation are obsolete
                self._chains.pop(whom, None)
            self._processes.start(self._rows[name].restarted())

    def start(self, row: ProcessSpec) -> None:
        self._processes.start(row)

    def row(self, name: str) -> ProcessSpec:
        return self._rows[name]

    def order(self, command: str, **arguments: Any) -> float:
        """Publish an operator command to all; return the time [s] just before."""
        assert self._bus is not None
        at = clock.now()
        self._bus.publish(self._operator.orders_key, encode(self._operator.orders(command, at, **arguments)))
        return at

    def cut_off(self, *robots: int) -> float:
        """Block all messages between `robots` and the others, world included; return the time [s] just before."""
        inside = [robot_name(robot) for robot in robots]
        outside = [robot_name(r) for r in self.scenario.mission.robots if r not in robots] + [WORLD_NAME]
        pairs = [pair for a in inside for b in outside for pair in ((a, b), (b, a))]
        return self.order(WEATHER, cut=pairs)

    def heal(self) -> float:
        """Heal the partition; return the time [s] just before."""
        return self.order(WEATHER, heal=True)

    # --- what is heard of it ---------------------------------------------------------------------------------------

    def listen(self) -> None:
        """Receive all pending messages and update the state of the team."""
        for arrival in self._inbox.take():
            where = address(arrival.key)
            if not isinstance(arrival.payload, bytes) or where is None:
                continue
            try:
                self._hear(decode(arrival.payload, TOPIC[where.topic].type))
            except BadMessage:
                continue
        del self.events[:-EVENTS_MAX], self.tracking[:-EVENTS_MAX]

    def _hear(self, message: Message) -> None:
        robot = robot_id_of(message.header.sender)
        match message:
            case PoseStamped() if robot is not None:
                self._poses[robot] = message
            case Truth():
                self.speeds_mps = {robot.id: abs(robot.linear_x) for robot in message.robots}
                moving = (robot for robot, speed_mps in self.speeds_mps.items() if speed_mps > REST_MPS)
                self.moved_at |= dict.fromkeys(moving, message.header.stamp)
            case Tracking():
                self.tracking.append(message)
            case Event():
                self.events.append(message)
                if message.kind == "chain" and robot is not None and message.term is not None:
                    version = (structs.astuple(message.term), message.data.get("seq"))
                    self._chains[robot] = (version, tuple(message.data["chain"]))

            case Status(counters=counters) if robot is not None and "config_seq" in counters:
                self._catch_up(robot, counters["config_n"], counters["config_seq"])

    def _catch_up(self, robot: int, n: float, seq: float) -> None:
        """Update a robot's chain from the config version in its status, in case its chain event was lost.

        The chain is that of a robot that reported the same version.
        """
        known = max(self._chains.values(), default=None)
        if known is not None and (known[0][0][0], known[0][1]) == (n, seq):
            self._chains[robot] = known

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
        speaking = [robot for robot in self.scenario.mission.robots if self._speaks(robot)]
        said = {self._chains.get(robot) for robot in speaking}
        if len(said) != 1 or (agreed := said.pop()) is None:
            return ()
        chain = agreed[1]
        return chain if set(chain) <= set(speaking) and self._leads() == chain[0] else ()

    def _speaks(self, robot: int) -> bool:
        pose = self._poses.get(robot)
        return pose is not None and clock.now() - pose.header.stamp < SPEAKING_S

    def _leads(self) -> int | None:
        leaders = [robot for robot, pose in self._poses.items() if pose.role is Role.LEADER and self._speaks(robot)]
        return leaders[0] if len(leaders) == 1 else None

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
            raise Broken(f"{broken}: {self.describe()}") from None
        return last

    def describe(self) -> str:
        """Return the roles and chains of the robots as text, for error messages."""
        roles = {r: str(p.role) for r, p in sorted(self._poses.items()) if self._speaks(r)}
        chains = {robot: chain for robot, (_, chain) in sorted(self._chains.items())}
        return f"roles {roles}, chains {chains}"

    def first(self, kind: str, since: float, fits: Callable[[Event], bool]) -> float | None:
        """Return the stamp [s] of the first `kind` event since `since` that `fits`, by its sender's clock, or None."""
        stamps = [e.header.stamp for e in self.events if e.kind == kind and e.header.stamp >= since and fits(e)]
        return min(stamps, default=None)

    def adopted(self, since: float, robots: Sequence[int], fits: Callable[[Sequence[int]], bool]) -> float | None:
        """Return the time [s] when the last of `robots` adopted a chain that `fits`; None until all have."""
        first: dict[str, float] = {}
        for event in self.events:
            if event.kind == "chain" and event.header.stamp >= since and fits(event.data["chain"]):
                first.setdefault(event.header.sender, event.header.stamp)
        at = [first.get(robot_name(robot), float("inf")) for robot in robots]
        return max(at) if at and max(at) < float("inf") else None
