"""Re-execution of a node's core from its journal, and comparison call by call with the recorded output.

The core is started and fed as the journal says. Regression test for every refactoring: same inputs, same bytes.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct

from lfa.agents.agent import Agent
from lfa.protocol.errors import Refused
from lfa.protocol.mission import Mission
from lfa.protocol.node import Local, Node
from lfa.protocol.runtime import journal
from lfa.protocol.runtime.journal import JOURNAL_VERSION, Heading, Journal, JournalEntry, digest
from lfa.protocol.runtime.node_host import NodeHost, Sent
from lfa.protocol.topics import message_in
from lfa.protocol.witness import Witness
from lfa.world.description.scenario import Scenario
from lfa.world.physics.kinematics import Kinematic
from lfa.world.physics.rigid_bodies import Physics
from lfa.world.saved_state import Memory
from lfa.world.world import World

BODIES: dict[str, type[Physics] | type[Kinematic]] = {"Physics": Physics, "Kinematic": Kinematic}
_local_decoder = msgspec.msgpack.Decoder(Local)


class Difference(Struct, frozen=True):
    """First call with another output than recorded: its number from 1, its time [s], its input and its output now."""

    call: int
    at: float
    what: str
    now_returns: list[str]


class Comparison(Struct, frozen=True):
    """Result of the comparison of one journal; `difference` is None when every call returned the same bytes."""

    journal: str
    calls: int
    difference: Difference | None = None

    @property
    def equal(self) -> bool:
        return self.difference is None


def compare(path: Path) -> Comparison:
    """Re-execute the node of the journal at `path`, up to the last whole entry or the first difference.

    Raises Refused when the file is not a journal of this version.
    """
    try:
        heading, entries = journal.read(path)
    except (OSError, ValueError) as error:
        raise Refused(f"{path}: cannot be replayed ({error}): must be a journal of a run folder") from None
    host = NodeHost(node_of(path, heading), Journal(None, heading))
    calls = 0
    for entry in entries:
        calls += 1
        sent = call(host, entry)
        if digest(sent) != entry.digest:
            return Comparison(path.name, calls, Difference(calls, entry.at, _what(entry), _said(sent)))
    return Comparison(path.name, calls)


def call(host: NodeHost, entry: JournalEntry) -> Sent:
    match entry.kind:
        case "tick":
            return host.tick(entry.at)
        case "local":
            return host.deliver(entry.at, "", _local_decoder.decode(entry.payload), b"")
        case _:
            return host.message(entry.at, entry.key, entry.payload)


def node_of(path: Path, heading: Heading) -> Node:
    """Return the node in its state before the first call. Raises Refused when this version cannot construct it."""
    if heading.version != JOURNAL_VERSION:
        raise Refused(
            f"{path}: version {heading.version}: must be {JOURNAL_VERSION}, replay it with the lfa of its time"
        )
    make = _MAKE.get(str(heading.config.get("kind")))
    if make is None:
        known = ", ".join(_MAKE)
        raise Refused(f"{path}: kind {heading.config.get('kind')!r} of node: must be one of {known}")
    try:
        return make(heading, heading.config)
    except (KeyError, msgspec.ValidationError) as error:
        raise Refused(f"{path}: heading without what a {heading.config['kind']} is started with ({error})") from None


def _agent(heading: Heading, facts: dict[str, Any]) -> Node:
    return Agent(
        facts["robot_id"],
        heading.incarnation,
        facts["fleet"],
        heading.floor,
        _mission(facts),
        spare=facts.get("spare", False),
    )


def _witness(heading: Heading, facts: dict[str, Any]) -> Node:
    return Witness(facts["fleet"], heading.incarnation, heading.floor, _mission(facts))


def _world(heading: Heading, facts: dict[str, Any]) -> Node:
    scenario = msgspec.convert(facts["scenario"], Scenario)
    bodies = BODIES[facts["bodies"]]
    memory = msgspec.convert(facts.get("memory"), Memory | None)
    return World(facts["fleet"], scenario, facts["seed"], heading.incarnation, facts["start_at"], bodies, memory)


def _mission(facts: dict[str, Any]) -> Mission | None:
    return msgspec.convert(facts["mission"], Mission | None)


_MAKE: dict[str, Callable[[Heading, dict[str, Any]], Node]] = {"agent": _agent, "witness": _witness, "world": _world}


def _what(entry: JournalEntry) -> str:
    return "tick" if entry.kind == "tick" else f"{entry.kind} {entry.key}".rstrip()


def _said(sent: Sent) -> list[str]:
    """Format the messages that the node publishes now: one text for each message."""
    texts = []
    for to, payload in sent:
        texts.append(f"{to}: {message_in(to, payload)!r}")
    return texts
