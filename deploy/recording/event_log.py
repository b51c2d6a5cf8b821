"""Evaluation of the event log of a run: leaders' terms, durations of failovers, and order of terms (I2)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import zip_longest
from math import isfinite, nan
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct

from lfa.deploy.recording.recorder import EVENTS
from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import DamagedFile, decode_json

DIED = "died"
"""Kind of the end of a process that no fault announced."""
ENDING_FAULTS = ("kill", "terminate", "stop", "cut", DIED)
LINE_BYTES_MAX = 1024 * 1024
"""Longest line [bytes]: what a message of 64 KiB becomes at most; a longer one is damage."""
EVENTS_BYTES_MAX = 256 * 1024 * 1024
"""Length [bytes] above which an event log is refused: all of it is held in memory."""
Line = dict[str, Any]


class LeaderTerm(Struct):
    """Period of one lease holder, starting at its first accepted leader command. `term` is (n, issuer)."""

    term: tuple[int, int]
    robot_id: int
    from_s: float
    until_s: float | None
    """Time [s] when the next leader led, or when a fault ended this period; None: until the end of the run."""
    cause: str
    """Cause of the change of leader: `start`, or how the period before ended: the kind of fault, the change in its
    holder's lease event (`expired`, `released`), `reelection` of the same robot, or `handover`."""


class Failover(Struct):
    """Replacement of a lost leader; durations [ms] are measured from the fault."""

    cause: str
    victim: int
    at_s: float
    leader: int | None
    lease_ms: float | None
    """Duration [ms] until the new leader held the lease."""
    first_command_ms: float | None
    """Duration [ms] until a gateway accepted the new leader's first command."""
    chain_ms: float | None
    """Duration [ms] until all survivors had closed the chain."""


class FaultDone(Struct):
    """Fault that was injected during a run."""

    at_s: float
    kind: str
    target: int | str
    """Id of a robot, or the two sides of a cut, or the share of lost messages."""


class TermViolation(Struct):
    """Violation of an invariant, with its time [s] and a text that names the robots."""

    invariant: str
    at_s: float
    text: str


def lines(folder: Path) -> list[Line]:
    """Return the events of a run ordered by time; a last line truncated by a kill, and damaged lines, are skipped.

    An event is skipped too if it lacks what its kind has in every run: a member can publish any event. Raises Refused
    for a file that is far too long.
    """
    path = folder / EVENTS
    if not path.is_file():
        return []
    if path.stat().st_size > EVENTS_BYTES_MAX:
        raise Refused(f"{path}: longer than {EVENTS_BYTES_MAX} bytes, must be the events of one run")
    with path.open("rb") as file:
        return in_order(iter(lambda: file.readline(LINE_BYTES_MAX), b""))


def in_order(texts: Iterable[bytes]) -> list[Line]:
    """Return the events in the lines `texts`, ordered by time; damaged ones are skipped."""
    found = map(_line, texts)
    return sorted((line for line in found if line is not None), key=lambda line: float(line["t"]))


def of_kind(events: Sequence[Line], kind: str) -> Iterator[Line]:
    return (line for line in events if line["kind"] == kind)


def faults(events: Sequence[Line]) -> list[FaultDone]:
    return [FaultDone(line["t"], line["deed"], line["robot"]) for line in of_kind(events, "fault")]


def endings(events: Sequence[Line]) -> list[FaultDone]:
    """Return the faults, and the deaths of robots that no fault announced: the token vanished and did not return.

    A robot that released its lease before has left in order.
    """
    found, over_at = faults(events), _over_at(events)
    for number, line in enumerate(events):
        if line["kind"] not in (DIED, "peer_down") or not isinstance(line["robot"], int) or line["t"] > over_at:
            continue
        own = [other for other in events if other["robot"] == line["robot"]]
        back = any(_is_return(other, line) for other in events[number:])
        left = next((e.get("change") for e in reversed(own) if e["kind"] == "lease" and e["t"] <= line["t"]), None)
        if not back and left not in ("released", "handed_over"):
            found.append(FaultDone(line["t"], DIED, line["robot"]))
    return sorted(found, key=lambda fault: fault.at_s)


def _is_return(line: Line, vanished: Line) -> bool:
    return (
        line["kind"] == "peer_up" and vanished["kind"] == "peer_down" and line.get("name") == vanished.get("name")
        and line.get("incarnation") == vanished.get("incarnation")
    )  # fmt: skip


def asked_by_leader(line: Line) -> bool:
    """Return True if an event `formation` is a leader's own request, not an operator's nor a follower's echo."""
    return bool(line.get("by", "operator") != "operator")


def leader_terms(events: Sequence[Line]) -> list[LeaderTerm]:
    """Return the leaders' terms in order, from the leader commands accepted by all gateways."""
    found: list[LeaderTerm] = []
    done = endings(events)
    for line in of_kind(events, "leader_command"):
        term, robot, at_s = (line["term"][0], line["term"][1]), line["robot"], line["t"]
        if any((led.term, led.robot_id) == (term, robot) for led in found):
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
    """Return per robot the steps (time [s], place in the newest chain); the place is nan while out of the chain."""
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


def failovers(events: Sequence[Line], leader_terms: Sequence[LeaderTerm]) -> list[Failover]:
    """Return one failover for each fault or death that ended a leader's term.

    None for durations that the run did not reach.
    """
    found = []
    for led, successor in zip_longest(leader_terms, leader_terms[1:]):
        fault = next((f for f in endings(events) if _ended_by(f, led) and f.at_s == led.until_s), None)
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
                victim=led.robot_id,
                at_s=fault.at_s,
                leader=leader,
                lease_ms=_ms(fault.at_s, _held_from(acquired, successor)),
                first_command_ms=_ms(fault.at_s, None if successor is None else successor.from_s),
                chain_ms=_ms(fault.at_s, _chain_closed(later, led.robot_id)),
            )
        )
    return found


def _held_from(acquired: Sequence[float], successor: LeaderTerm | None) -> float | None:
    """Return the time [s] from which the new leader held the lease; None if it never said so.

    It says so after it has sent its first command, and that may arrive first: who commands holds the lease.
    """
    commands_s = float("inf") if successor is None else successor.from_s
    return min(acquired[0], commands_s) if acquired else None


def last_chain(events: Sequence[Line]) -> list[int]:
    """Return the chain of the newest config in any `chain` event; empty without one.

    Events after `over` are ignored: when the run stops, the leader sees other robots leave before itself.
    """
    over_at = _over_at(events)
    announced = [line for line in of_kind(events, "chain") if line["term"] is not None and line["t"] <= over_at]
    newest = max(announced, key=lambda line: (line["term"], line.get("seq", 0)), default=None)
    return [] if newest is None else list(newest["chain"])


def terms_that_went_back(events: Sequence[Line]) -> list[TermViolation]:
    """Return the violations of I2: over all gateways, no leader command of an older term follows a newer term."""
    newest: tuple[int, ...] = ()
    found = []
    for line in of_kind(events, "leader_command"):
        term = tuple(line["term"])
        if term < newest:
            text = f"robot {line['robot']} took a leader command of term {term} after one of term {newest}"
            found.append(TermViolation("I2", line["t"], text))
        newest = max(newest, term)
    return found


def _over_at(events: Sequence[Line]) -> float:
    """Return the time [s] at which the run stopped; inf if it did not."""
    return next((line["t"] for line in of_kind(events, "over")), float("inf"))


def _line(text: bytes) -> Line | None:
    try:
        line = decode_json(text, dict[str, Any])
        shape = msgspec.convert(line, _SHAPES.get(str(line.get("kind")), _LoggedEvent))
    except (DamagedFile, msgspec.ValidationError):
        return None
    return line if isfinite(shape.t) else None


class _LoggedEvent(Struct, kw_only=True):
    """What a line of each kind has at least; kinds with more are in `_SHAPES`."""

    t: float
    kind: str
    robot: Any
    term: tuple[int, int, int] | None


class _LoggedCommand(_LoggedEvent, kw_only=True):
    robot: int
    term: tuple[int, int, int]


class _LoggedFault(_LoggedEvent, kw_only=True):
    action: str = msgspec.field(name="deed")


class _LoggedChain(_LoggedEvent, kw_only=True):
    robot: int
    chain: list[int] = []
    seq: int = 0


class _LoggedRole(_LoggedEvent, kw_only=True):
    role: str


class _LoggedDecision(_LoggedEvent, kw_only=True):
    action: str


_SHAPES: dict[str, type[_LoggedEvent]] = {
    "leader_command": _LoggedCommand,
    "fault": _LoggedFault,
    "chain": _LoggedChain,
    "role": _LoggedRole,
    "decision": _LoggedDecision,
}


def _ended_by(fault: FaultDone, led: LeaderTerm) -> bool:
    return fault.kind in ENDING_FAULTS and fault.target == led.robot_id and fault.at_s >= led.from_s


def _given_up(events: Sequence[Line], before: LeaderTerm, successor: int) -> str:
    """Return how the term `before`, which no fault ended, came to its end."""
    if before.robot_id == successor:
        return "reelection"
    said = [e for e in of_kind(events, "lease") if e["robot"] == before.robot_id and e["t"] >= before.from_s]
    return next((str(e["change"]) for e in said if e.get("change") not in (None, "acquired")), "handover")


def _ending(done: Sequence[FaultDone], led: LeaderTerm, before_s: float) -> FaultDone | None:
    """Return the first fault until `before_s` [s] that can have ended the term."""
    return next((fault for fault in done if _ended_by(fault, led) and fault.at_s <= before_s), None)


def _chain_closed(later: Sequence[Line], victim: int) -> float | None:
    """Return the time [s] when the last member of the new chain first reported a chain without `victim`."""
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
