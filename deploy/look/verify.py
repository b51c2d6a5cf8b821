"""`lfa verify`: the invariants' checkers on a run of real processes.

The journals hold all that each process was told, by the one clock of the machine. Cores of agents and witness are run
again on theirs, which gives every effect of every lease; the gateways are run again on the world's, which gives every
command that moved a robot. What a killed process said in its last moment may be missing from its own journal: then
those who heard it tell.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer
from msgspec import Struct

from agents.agent import Agent
from deploy.look.again import call, node_of
from deploy.look.checkers import SAFETY, Checker, Violation
from deploy.run.folder import JOURNALS, scenario_of
from protocol import journal
from protocol.effects import AdoptChain, BecomeLeader, Effect, LeaseExtended, Send, StepDown
from protocol.gateway import Gateway
from protocol.host import Host
from protocol.journal import Entry, Heading, Journal, digest
from protocol.messages import BadMessage, CmdVel, Fence, Grant, LeaseNote, Member, Promise, Propose, Release, decode
from protocol.mission import Refused, robot_id_of
from protocol.node import Local, PeerDown, PeerUp, RouterLost
from protocol.timing import Timing, timing_of
from protocol.topics import TOPIC, WORLD_NAME, address
from protocol.witness import Witness

Tell = Callable[[Checker], None]
"""Tells one checker something."""
_local_decoder = msgspec.msgpack.Decoder(Local)


class Happening(Struct, frozen=True):
    """What the checkers are to be told, at which moment [s]."""

    at: float
    tell: Tell


class Verdict(Struct, frozen=True):
    journals: int
    happenings: int
    broken: tuple[Violation, ...]
    """With times from the run's first journalled moment on."""


def command(
    folder: Annotated[Path, typer.Argument(help="A run folder with journals.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print the verdict as JSON.")] = False,
) -> int:
    """Exit code 1 when an invariant was broken."""
    verdict = verify(folder)
    if as_json:
        print(msgspec.json.encode(verdict).decode())
    else:
        for one in verdict.broken:
            print(f"{one.name} broken at {one.at:.3f} s: {one.text}")
        names = ", ".join(checker.name for checker in SAFETY)
        print(
            f"{verdict.journals} journals, {verdict.happenings} happenings, {names}: {len(verdict.broken)} violations"
        )
    return 1 if verdict.broken else 0


def verify(folder: Path) -> Verdict:
    """Check the run in `folder`. Raises Refused when it has no journals, or those of another version of the cores."""
    paths = sorted((folder / JOURNALS).glob("*.bin"))
    if not paths:
        raise Refused(f"{folder}: no journals, must be a run folder of lfa run or lfa sim")
    timing = timing_of(scenario_of(folder).mission.profile)
    happenings = sorted((h for path in paths for h in _happenings(path, timing)), key=lambda h: h.at)
    checkers = [checker(timing) for checker in SAFETY]
    for happening in happenings:
        for checker in checkers:
            happening.tell(checker)
    began = happenings[0].at if happenings else 0.0
    broken = sorted((v for checker in checkers for v in checker.violations), key=lambda v: v.at)
    return Verdict(len(paths), len(happenings), tuple(Violation(v.name, v.at - began, v.text) for v in broken))


def _happenings(path: Path, timing: Timing) -> Iterator[Happening]:
    try:
        heading, entries = journal.read(path)
    except (OSError, ValueError) as error:
        raise Refused(f"{path}: cannot be read ({error})") from None
    if heading.node == WORLD_NAME:
        return _of_gateways(heading, entries, timing)
    return _of_lease(path, heading, entries, timing)


def _tell(what: str, *facts: Any) -> Tell:
    """The method of `Checker` of that name, called with these facts."""
    return lambda checker: getattr(checker, what)(*facts)


# --- leases ---------------------------------------------------------------------------------------------------------


def _of_lease(path: Path, heading: Heading, entries: Iterator[Entry], timing: Timing) -> Iterator[Happening]:
    node = node_of(path, heading)
    robot = robot_id_of(heading.node)
    if robot is None or not isinstance(node, Agent | Witness):
        return
    me = Member(robot, heading.incarnation)
    effects: list[Effect] = []
    _overhear(node, effects)
    host = Host(node, Journal(None, heading))
    at = 0.0
    for entry in entries:
        at = max(at, entry.at)
        for tell in _heard(entry, at):
            yield Happening(at, tell)
        effects.clear()
        if digest(call(host, entry)) != entry.digest:
            raise Refused(f"{path}: cannot be verified, it was written by another version of the cores (lfa replay)")
        for effect in effects:
            for tell in _told(effect, me, at, timing):
                yield Happening(at, tell)
    yield Happening(at, _tell("leads_no_more", at, me))


def _overhear(node: Agent | Witness, effects: list[Effect]) -> None:
    """Note the effects of the node's lease as it carries them out."""
    name = "_apply" if isinstance(node, Agent) else "_carry_out"
    carry_out = getattr(node, name)

    def noted(done: list[Effect], now: float) -> Any:
        effects.extend(done)
        return carry_out(done, now)

    setattr(node, name, noted)


def _told(effect: Effect, me: Member, at: float, timing: Timing) -> Iterator[Tell]:
    match effect:
        case BecomeLeader(term, expiry) | LeaseExtended(term, expiry):
            yield _tell("leads", at, me, term, expiry)
        case StepDown():
            yield _tell("leads_no_more", at, me)
        case AdoptChain(config):
            yield _tell("adopts", at, me, config)
        case Send(_, Propose() as body):
            yield _tell("proposes", at, me, body)
            if body.holder == me:  # its own voter's grant as well
                own = Grant(body.term, body.round, body.config.version, 0.0)
                yield _tell("grants", at, me, own, at + timing.grant_s)
        case Send(_, Grant() as body):
            yield _tell("grants", at, me, body, at + timing.grant_s)
        case Send(_, Release() as body):
            yield _tell("releases", at, body.term)


def _heard(entry: Entry, at: float) -> Iterator[Tell]:
    """What a message says of its sender, which may not have lived to journal that it said it."""
    note = _message(entry)
    source = robot_id_of(note.header.sender) if isinstance(note, LeaseNote) else None
    if not isinstance(note, LeaseNote) or source is None:
        return
    sender = Member(source, note.header.incarnation)
    match note.body:
        case Propose() as body:
            yield _tell("proposes", at, sender, body)
        case Promise() as body:
            yield _tell("promises", at, sender, body)
        case Release() as body:
            yield _tell("releases", at, body.term)


# --- gateways -------------------------------------------------------------------------------------------------------


class _Gateways:
    """The gateways of one life of the world, fed as the world fed them."""

    def __init__(self, robots: Sequence[int], incarnation: int, timing: Timing, now: float) -> None:
        self.gateways = {robot: Gateway(robot, incarnation, timing, now) for robot in robots}
        self._cut_off = False

    def feed(self, entry: Entry, at: float) -> Iterator[Tell]:
        message = _message(entry)
        where = address(entry.key) if entry.key else None
        match message:
            case CmdVel() if where is not None and (robot := robot_id_of(where.owner)) in self.gateways:
                gateway = self.gateways[robot]
                if gateway.command(message, at) is None:
                    yield _tell("obeys", at, robot, message, at - message.gateway.time)
                    yield _tell("bars", at, robot, message.term)
            case LeaseNote(body=Fence() as fence) if where is not None and where.to is not None:
                robot = int(where.to.removeprefix("gateway"))
                if robot in self.gateways:
                    self.gateways[robot].fence(fence, at)
                    yield _tell("bars", at, robot, fence.term)
            case PeerUp(name, incarnation) if (robot := robot_id_of(name)) in self.gateways:
                self._cut_off = False
                self.gateways[robot].agent_up(incarnation, at)
            case PeerDown(name, incarnation) if (robot := robot_id_of(name)) in self.gateways and not self._cut_off:
                self.gateways[robot].agent_down(incarnation, at)
            case RouterLost():
                self._cut_off = True


def _of_gateways(heading: Heading, entries: Iterator[Entry], timing: Timing) -> Iterator[Happening]:
    robots = heading.config["scenario"]["mission"]["robots"]
    gateways: _Gateways | None = None
    at = 0.0
    for entry in entries:
        at = max(at, entry.at)
        if gateways is None:
            gateways = _Gateways(robots, heading.incarnation, timing, at)
            for robot in robots:
                yield Happening(at, _tell("gateway_starts", at, robot, at + timing.grant_s))
        for tell in gateways.feed(entry, at):
            yield Happening(at, tell)


def _message(entry: Entry) -> Any:
    """What came with this call, None for a tick and for bytes that are none of ours."""
    if entry.kind == "local":
        return _local_decoder.decode(entry.payload)
    where = address(entry.key) if entry.kind == "message" else None
    if where is None or where.topic not in ("lease", "cmd_vel"):
        return None
    try:
        return decode(entry.payload, TOPIC[where.topic].type)
    except BadMessage:
        return None
