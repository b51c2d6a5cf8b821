"""What the events of a run say: who led when, what each failover took, and whether terms ever went back."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import zip_longest
from math import nan
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct

from lfa.deploy.recording.recorder import EVENTS

ENDING_FAULTS = ("kill", "terminate", "stop", "cut")
Line = dict[str, Any]


class LeaderTerm(Struct):
    """One holder of the lease, from its first accepted leader command on. `term` is (n, issuer)."""

    term: tuple[int, int]
    robot_id: int
    from_s: float
    until_s: float | None
    """When the next one led, or when a fault ended this one; None: to the end."""
    cause: str
    """`start`; or how the one before ended: the fault, the word of its holder's lease event (`expired`, `released`),
    `reelection` of the same robot, `handover`."""


class Failover(Struct):
    """What it took to replace a leader that was lost; durations from the fault on [ms]."""

    cause: str
    victim: int
    at_s: float
    leader: int | None
    lease_ms: float | None
    """Until the new leader held the lease."""
    first_command_ms: float | None
    """Until a gateway accepted the new leader's first command."""
    chain_ms: float | None
    """Until all survivors had closed the chain."""


class FaultDone(Struct):
    at_s: float
    kind: str
    target: int | str
    """A robot's id, or whom a cut parts, or what share is lost."""


class TermViolation(Struct):
    """An invariant that did not hold, when, and between whom."""

    invariant: str
    at_s: float
    text: str


def lines(folder: Path) -> list[Line]:
    """The events of a run in the order of their times; a last line cut off by a kill is left out."""
    path = folder / EVENTS
    found = [_line(text) for text in path.read_bytes().splitlines()] if path.is_file() else []
    return sorted((line for line in found if line is not None), key=lambda line: float(line["t"]))


def of_kind(events: Sequence[Line], kind: str) -> Iterator[Line]:
    return (line for line in events if line["kind"] == kind)


def faults(events: Sequence[Line]) -> list[FaultDone]:
    return [FaultDone(line["t"], line["deed"], line["robot"]) for line in of_kind(events, "fault")]


def asked_by_leader(line: Line) -> bool:
    """Whether an event `formation` is a leader's own request: not an operator's, nor a follower's echo."""
    return bool(line.get("by", "operator") != "operator")


def reigns(events: Sequence[Line]) -> list[LeaderTerm]:
    """Who led, by accepted leader commands over all gateways."""
    found: list[LeaderTerm] = []
    done = faults(events)
    for line in of_kind(events, "leader_command"):
        term, robot, at_s = (line["term"][0], line["term"][1]), line["robot"], line["t"]
        if any((reign.term, reign.robot_id) == (term, robot) for reign in found):
            continue
        ended = _ending(done, found[-1], at_s) if found else None
        if found:
            found[-1].until_s = at_s if ended is None else ended.at_s
        cause = "start" if not found else ended.kind if ended is not None else _given_up(events, found[-1], robot)
        found.append(LeaderTerm(term, robot, at_s, None, cause))
    if found:
        last = _ending(done, found[-1], float("inf"))
        found[-1].until_s = None if last is None else last.at_s
    return found


def places(events: Sequence[Line], robots: Sequence[int], end_s: float) -> dict[int, list[tuple[float, float]]]:
    """Of each robot, its place in the newest chain from each moment on [s]; nan while it is out of it."""
    newest: tuple[Any, ...] = ()
    steps: dict[int, list[tuple[float, float]]] = {robot: [(0.0, nan)] for robot in robots}
    for line in of_kind(events, "chain"):
        version = (tuple(line["term"] or ()), line.get("seq", 0))
        if newest and version <= newest:
            continue
        newest, chain = version, line.get("chain", [])
        for robot, known in steps.items():
            known.append((line["t"], float(chain.index(robot)) if robot in chain else nan))
    return {robot: [*known, (end_s, known[-1][1])] for robot, known in steps.items()}


def failovers(events: Sequence[Line], reigns: Sequence[LeaderTerm]) -> list[Failover]:
    """One for each fault that ended a reign; None where the run ended before it was over."""
    found = []
    for reign, successor in zip_longest(reigns, reigns[1:]):
        fault = next((f for f in faults(events) if _ended_by(f, reign) and f.at_s == reign.until_s), None)
        if fault is None:
            continue
        later = [line for line in events if line["t"] >= fault.at_s]
        leader = None if successor is None else successor.robot_id
        acquired = [
            line["t"]
            for line in of_kind(later, "lease")
            if line["robot"] == leader and line.get("change") == "acquired"
        ]
        found.append(
            Failover(
                cause=fault.kind,
                victim=reign.robot_id,
                at_s=fault.at_s,
                leader=leader,
                lease_ms=_ms(fault.at_s, acquired[0] if acquired else None),
                first_command_ms=_ms(fault.at_s, None if successor is None else successor.from_s),
                chain_ms=_ms(fault.at_s, _chain_closed(later, reign.robot_id)),
            )
        )
    return found


def last_chain(events: Sequence[Line]) -> list[int]:
    """The chain of the newest config that anybody spoke of; empty when nobody did.

    Not what the team makes of it when it is told to stop: whoever leads sees some of the others go before itself.
    """
    over_at = next((line["t"] for line in of_kind(events, "over")), float("inf"))
    spoken = [line for line in of_kind(events, "chain") if line["term"] is not None and line["t"] <= over_at]
    newest = max(spoken, key=lambda line: (line["term"], line.get("seq", 0)), default=None)
    return [] if newest is None else list(newest["chain"])


def terms_that_went_back(events: Sequence[Line]) -> list[TermViolation]:
    """I2: over all gateways, no leader command of an older term is accepted after one of a newer term."""
    newest: tuple[int, ...] = ()
    found = []
    for line in of_kind(events, "leader_command"):
        term = tuple(line["term"])
        if term < newest:
            text = f"robot {line['robot']} took a leader command of term {term} after one of term {newest}"
            found.append(TermViolation("I2", line["t"], text))
        newest = max(newest, term)
    return found


def _line(text: bytes) -> Line | None:
    try:
        line = msgspec.json.decode(text, type=dict[str, Any])
    except msgspec.DecodeError:
        return None
    return line if "t" in line and "kind" in line else None


def _ended_by(fault: FaultDone, reign: LeaderTerm) -> bool:
    return fault.kind in ENDING_FAULTS and fault.target == reign.robot_id and fault.at_s >= reign.from_s


def _given_up(events: Sequence[Line], before: LeaderTerm, successor: int) -> str:
    """How `before`, which no fault ended, came to its end."""
    if before.robot_id == successor:
        return "reelection"
    said = [e for e in of_kind(events, "lease") if e["robot"] == before.robot_id and e["t"] >= before.from_s]
    return next((str(e["change"]) for e in said if e.get("change") not in (None, "acquired")), "handover")


def _ending(done: Sequence[FaultDone], reign: LeaderTerm, before_s: float) -> FaultDone | None:
    """The first fault that can have ended `reign`."""
    return next((fault for fault in done if _ended_by(fault, reign) and fault.at_s <= before_s), None)


def _chain_closed(later: Sequence[Line], victim: int) -> float | None:
    """When the last of the new chain's members first spoke of a chain without `victim`."""
    closed: dict[int, float] = {}
    members: list[int] = []
    for line in of_kind(later, "chain"):
        chain = line.get("chain", [])
        if victim not in chain:
            members = members or chain
            closed.setdefault(line["robot"], line["t"])
    return max((closed[m] for m in members), default=None) if all(m in closed for m in members) else None


def _ms(since_s: float, at_s: float | None) -> float | None:
    return None if at_s is None else round((at_s - since_s) * 1000.0, 3)
