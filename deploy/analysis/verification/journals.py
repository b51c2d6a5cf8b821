"""Check of the lease's invariants on a run of real processes, from their journals.

The journals hold every input of each process, by the single clock of the machine. The cores of agents and witness are
re-executed on their journals, which yields every effect of every lease; the gateways are re-executed on the world's
journal, which yields every command that moved a robot. The last messages of a killed process may be missing from its
own journal; they are then taken from the journals of their receivers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, cast

import msgspec
from msgspec import Struct

from lfa.agents.agent import Agent
from lfa.deploy.analysis.verification.checker import Arguments, Checker, CheckerGroup, Report, Violation
from lfa.deploy.analysis.verification.lease_observer import report_effect, report_message
from lfa.deploy.analysis.verification.reexecution import call, node_of
from lfa.deploy.analysis.verification.safety import SAFETY
from lfa.deploy.recording import event_log
from lfa.deploy.recording.run_folder import JOURNALS, scenario_of
from lfa.protocol.errors import Refused
from lfa.protocol.lease.effects import Effect
from lfa.protocol.lease.gateway import Gateway
from lfa.protocol.lease.timing import Timing, timing_for
from lfa.protocol.messages.consensus import Fence, LeaseNote, Member
from lfa.protocol.messages.robot import CmdVel
from lfa.protocol.mission import Mission
from lfa.protocol.names import robot_id_of, robot_name
from lfa.protocol.node import Local, PeerDown, PeerUp, RouterLost
from lfa.protocol.runtime import journal
from lfa.protocol.runtime.journal import Heading, Journal, JournalEntry, digest
from lfa.protocol.runtime.node_host import NodeHost
from lfa.protocol.topics import WORLD_NAME, address, message_in
from lfa.protocol.witness import Witness

_local_decoder = msgspec.msgpack.Decoder(Local)


class Happening(Struct, frozen=True):
    """Fact for the checkers, with its time [s]: a method of `Checker`, and its arguments."""

    at: float
    fact: Callable[..., None]
    arguments: tuple[Any, ...]


class JournalVerdict(Struct, frozen=True):
    """Result of the invariant checks of one run."""

    journals: int
    """Number of journals read."""
    happenings: int
    """Number of facts given to the checkers."""
    broken: tuple[Violation, ...]
    """Violations, with times [s] from the first journalled time of the run."""


def verify(folder: Path) -> JournalVerdict:
    """Check the run in `folder`. Raises Refused when journals are missing or of another version of the cores."""
    paths = sorted((folder / JOURNALS).glob("*.bin"))
    if not paths:
        raise Refused(f"{folder}: no journals, must be a run folder of lfa run or lfa sim")
    mission = scenario_of(folder).mission
    _refuse_lost({path.stem.rpartition("-")[0] for path in paths}, folder, mission)
    timing = timing_for(mission)
    happenings = sorted((h for path in paths for h in _happenings(path, timing)), key=lambda h: h.at)
    checkers = [checker(timing) for checker in SAFETY]
    group = CheckerGroup(checkers)
    for happening in happenings:
        group.report(happening.fact, *happening.arguments)
    began = happenings[0].at if happenings else 0.0
    broken = sorted((v for checker in checkers for v in checker.violations), key=lambda v: v.at)
    return JournalVerdict(len(paths), len(happenings), tuple(Violation(v.name, v.at - began, v.text) for v in broken))


def _refuse_lost(journalled: set[str], folder: Path, mission: Mission) -> None:
    """Raise Refused when a process that took part has no journal: its actions would look like violations by others."""
    team = {WORLD_NAME, *map(robot_name, mission.robots)}
    for event in event_log.lines(folder):
        came = event["kind"] == "peer_up"  # a mere sender counts only if it is of the team
        name = str(event.get("name" if came else "from"))
        took_part = name in team or (came and robot_id_of(name) is not None)
        if took_part and name not in journalled:
            raise Refused(f"{folder}: no journal of {name}, which took part: must be the whole run folder")


def obeyed(folder: Path) -> Iterator[tuple[float, CmdVel]]:
    """Yield time [s] and command of each command that a gateway accepted; works for an unfinished run, too."""
    timing = timing_for(scenario_of(folder).mission)
    for path in sorted((folder / JOURNALS).glob(f"{WORLD_NAME}-*.bin")):
        for happening in _happenings(path, timing):
            if happening.fact is Checker.obeys:
                yield happening.at, happening.arguments[2]


def _happenings(path: Path, timing: Timing) -> list[Happening]:
    """Return what the journal at `path` tells of its process. Raises Refused for a file that is no journal."""
    found: list[Happening] = []

    def report(fact: Callable[[Checker, *Arguments], None], *arguments: *Arguments) -> None:
        at, *_ = cast("tuple[float, *tuple[Any, ...]]", arguments)  # as of every fact
        found.append(Happening(at, fact, arguments))

    try:
        heading, entries = journal.read(path)
    except (OSError, ValueError) as error:
        raise Refused(f"{path}: cannot be read ({error})") from None
    if heading.node == WORLD_NAME:
        _report_gateways(report, heading, entries, timing)
    else:
        _report_lease(report, path, heading, entries, timing)
    return found


# --- leases ---------------------------------------------------------------------------------------------------------


def _report_lease(
    report: Report, path: Path, heading: Heading, entries: Iterator[JournalEntry], timing: Timing
) -> None:
    node = node_of(path, heading)
    robot = robot_id_of(heading.node)
    if robot is None or not isinstance(node, Agent | Witness):
        return
    me = Member(robot, heading.incarnation)
    effects: list[Effect] = []
    node.lease_observer = lambda observed: effects.extend(observed.effects)
    host = NodeHost(node, Journal(None, heading))
    at, agreed = 0.0, None
    for entry in entries:
        at = max(at, entry.at)
        note = _message(entry)
        if isinstance(note, LeaseNote):
            report_message(report, note, at)
        effects.clear()
        if digest(call(host, entry)) != entry.digest:
            raise Refused(f"{path}: cannot be verified, it was written by another version of the cores (lfa replay)")
        if agreed is None and node.lease is not None:
            agreed = node.lease.agreed
            report(Checker.holds, at, me, agreed)
        for effect in effects:
            report_effect(report, effect, me, at, entry.at + timing.grant_s, float)
    report(Checker.leads_no_more, at, me)


# --- gateways -------------------------------------------------------------------------------------------------------


class _Gateways:
    """Gateways of one incarnation of the world, fed with the same inputs as in the run."""

    def __init__(self, robots: Sequence[int], incarnation: int, timing: Timing, now: float) -> None:
        self.gateways = {robot: Gateway(robot, incarnation, timing, now) for robot in robots}
        self._cut_off = False

    def feed(self, report: Report, entry: JournalEntry, at: float) -> None:
        """Deliver an input of the world to the gateways, and report what they obey."""
        message = _message(entry)
        where = address(entry.key) if entry.key else None
        match message:
            case CmdVel() if where is not None and (robot := robot_id_of(where.owner)) in self.gateways:
                gateway = self.gateways[robot]
                if gateway.command(message, at) is None:
                    report(Checker.obeys, at, robot, message, at - message.gateway.time)
                    report(Checker.bars, at, robot, message.term)
            case LeaseNote(body=Fence() as fence) if where is not None and where.to is not None:
                robot = int(where.to.removeprefix("gateway"))
                if robot in self.gateways:
                    report(Checker.bars, at, robot, self.gateways[robot].fence(fence, at).term)
            case PeerUp(name, incarnation) if (robot := robot_id_of(name)) in self.gateways:
                self._cut_off = False
                self.gateways[robot].agent_up(incarnation, at)
            case PeerDown(name, incarnation) if (robot := robot_id_of(name)) in self.gateways and not self._cut_off:
                self.gateways[robot].agent_down(incarnation, at)
            case RouterLost():
                self._cut_off = True


def _report_gateways(report: Report, heading: Heading, entries: Iterator[JournalEntry], timing: Timing) -> None:
    robots = heading.config["scenario"]["mission"]["robots"]
    gateways: _Gateways | None = None
    at = 0.0
    for entry in entries:
        at = max(at, entry.at)
        if gateways is None:
            gateways = _Gateways(robots, heading.incarnation, timing, at)
            for robot in robots:
                report(Checker.gateway_starts, at, robot, at + timing.grant_s)
        gateways.feed(report, entry, at)


def _message(entry: JournalEntry) -> Any:
    """Return the lease or command message, or local event, of a journal entry; None for all other entries."""
    if entry.kind == "local":
        return _local_decoder.decode(entry.payload)
    where = address(entry.key) if entry.kind == "message" else None
    if where is None or where.topic not in ("lease", "cmd_vel"):
        return None
    return message_in(entry.key, entry.payload)
