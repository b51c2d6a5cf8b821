"""Facts about what a run did: leader changes, stops, contacts and waits, and the links between them and their causes.

From the event log and the ground truth. The lines that announce a fault are not read.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from lfa.deploy.analysis.causes.fact import Fact, called
from lfa.deploy.analysis.episodes import stretches
from lfa.deploy.client.term_count import TermCount
from lfa.deploy.recording import event_log
from lfa.deploy.recording.event_log import Line
from lfa.deploy.recording.mcap_reader import Array, RecordedRun
from lfa.protocol.names import robot_name
from lfa.protocol.transport.link_model import LINK_CONDITIONS

STILL_MPS, DRIVES_MPS = 0.01, 0.05
"""Speeds [m/s]: below the first a robot stands, above the second it drives."""
STILL_RADPS = 0.05
STOP_S = 1.0
"""Least duration [s] of a stop."""
APART_S = 0.2
"""Gap [s] up to which two stretches of standing are one stop."""
CONTACTS_APART_S = 2.0
"""Time [s] within which further touches of the same two bodies belong to the first one."""
ASIDE = ("hang", "resume", LINK_CONDITIONS)
"""Commands on the operator's topic that only simulate a fault: none of them is an order."""


def facts(seen: RecordedRun, events: Sequence[Line], robots: Sequence[int]) -> list[Fact]:
    """Return what the run did, by time; events after its end are left out."""
    over_s = next((line["t"] for line in events if line["kind"] in ("over", "end")), float("inf"))
    lines = [line for line in events if line["t"] <= over_s and line["kind"] != "fault"]
    found = [
        *leader_changes(lines),
        *stops(seen, lines, robots),
        *contacts(lines),
        *_decisions(lines),
        *_leases(lines),
        *_inputs(lines),
        *_others(lines),
    ]
    return sorted(found, key=lambda fact: fact.at_s)


def leader_changes(lines: Sequence[Line]) -> Iterator[Fact]:
    """Yield the first leader and each change of leader, by the commands that gateways obeyed."""
    leader: int | None = None
    commands = list(event_log.of_kind(lines, "leader_command"))
    terms = TermCount(line["term"][0] for line in commands)
    for line in commands:
        robot = line["robot"]
        if robot == leader:
            continue
        new = called(robot_name(robot))
        if leader is None:
            yield Fact(line["t"], "takeover", robot_name(robot), f"{new} led, the first one")
        else:
            old = robot_name(leader)
            text = f"{new} led instead of {called(old)} (term {terms.number(line['term'][0])})"
            yield Fact(line["t"], "leader change", robot_name(robot), text, other=old)
        leader = robot


def stops(seen: RecordedRun, lines: Sequence[Line], robots: Sequence[int]) -> Iterator[Fact]:
    """Yield the stops of each robot that had driven, up to the mission's goal."""
    goal_s = min((line["t"] for line in event_log.of_kind(lines, "goal")), default=float("inf"))
    chains: list[tuple[float, list[int]]] = [
        (line["t"], line.get("chain", [])) for line in event_log.of_kind(lines, "chain")
    ]
    for robot in robots:
        rows = seen.truth.get(robot)
        if rows is None:
            continue
        for from_s, until_s in _still(rows):
            if from_s < goal_s:
                chain = next((chain for at_s, chain in reversed(chains) if at_s <= from_s), [])
                ahead = chain[chain.index(robot) - 1] if robot in chain[1:] else None
                lasting = None if until_s >= rows[-1, 0] - APART_S else until_s
                text = f"{called(robot_name(robot))} stood" + (
                    " to the end" if lasting is None else f" for {until_s - from_s:.1f} s"
                )
                other = "" if ahead is None else robot_name(ahead)
                yield Fact(from_s, "stop", robot_name(robot), text, lasting, other)


def _still(rows: Array) -> list[tuple[float, float]]:
    """Return the stretches of at least `STOP_S` in which a robot stood after it had driven."""
    driven = np.maximum.accumulate(np.abs(rows[:, 4]) > DRIVES_MPS)
    still = (np.abs(rows[:, 4]) < STILL_MPS) & (np.abs(rows[:, 5]) < STILL_RADPS) & driven
    return [span for span in stretches(rows[:, 0], still, APART_S) if span[1] - span[0] >= STOP_S]


def contacts(lines: Sequence[Line]) -> Iterator[Fact]:
    last: dict[tuple[object, object], float] = {}
    for line in event_log.of_kind(lines, "contact"):
        robot, other = line["robot"], line.get("other")
        before_s = last.get((robot, other))
        last[robot, other] = line["t"]
        if before_s is not None and line["t"] - before_s < CONTACTS_APART_S:
            continue
        body = _body(other)
        text = f"{called(robot_name(robot))} touched {called(body)}"
        yield Fact(line["t"], "contact", robot_name(robot), text, other=body)


def _body(other: object) -> str:
    return robot_name(other) if isinstance(other, int) else str(other)


def _decisions(lines: Sequence[Line]) -> Iterator[Fact]:
    """Yield each decision about an obstacle, and a wait for each decision to wait."""
    for line in event_log.of_kind(lines, "decision"):
        action, robot = line["action"], line["robot"]
        if action == "resume" or not isinstance(robot, int):
            continue
        name, kind = robot_name(robot), line.get("class", "")
        met = f"{called(name)} met a {kind} obstacle, {float(line.get('free_m', 0.0)):.2f} m free ahead"
        yield Fact(line["t"], "obstacle", name, met, other=str(kind))
        if action == "wait":
            yield Fact(line["t"], "wait", name, f"{called(name)} waited", other=str(kind))
        else:
            yield Fact(line["t"], "decision", name, f"{called(name)} decided: {action}", other=str(kind))


def _leases(lines: Sequence[Line]) -> Iterator[Fact]:
    """Yield each end of a lease, and each role in which a robot waits after it had driven."""
    had_role: set[int] = set()
    chain: list[int] | None = None
    for line in lines:
        chain = line["chain"] if line["kind"] == "chain" else chain
        robot = line["robot"]
        if not isinstance(robot, int):
            continue
        name = robot_name(robot)
        if line["kind"] == "lease" and line.get("change") != "acquired":
            text = f"the lease of {called(name)} ended: {str(line.get('change')).replace('_', ' ')}"
            yield Fact(line["t"], "lease lost", name, text, other=str(line.get("change")))
        if line["kind"] == "role":
            if line["role"] == "waiting" and robot in had_role:
                reason = "for a leader" if chain is None or robot in chain else "out of the chain"
                yield Fact(line["t"], "wait", name, f"{called(name)} waited, {reason}", other="role")
            if line["role"] != "waiting":
                had_role.add(robot)


def _inputs(lines: Sequence[Line]) -> Iterator[Fact]:
    for line in lines:
        robot = line["robot"]
        if not isinstance(robot, int):
            continue
        name, state = robot_name(robot), line.get("state")
        if line["kind"] == "input" and state in ("lost", "slow"):
            text = (
                f"{called(name)} missed its {line.get('input')}"
                if state == "lost"
                else (f"the scans of {called(name)} came at {line.get('rate_hz')} Hz only")
            )
            yield Fact(line["t"], "input lost", name, text, other=str(line.get("input")))
        if line["kind"] == "stuck" and line.get("stuck"):
            yield Fact(line["t"], "stuck", name, f"{called(name)} was stuck ({line.get('reason')})")
        if line["kind"] == "left_out" and isinstance(line.get("robot_left"), int):
            left = robot_name(line["robot_left"])
            text = f"{called(name)} took {called(left)} out of the chain"
            yield Fact(line["t"], "left out", left, text, other=name)


def _others(lines: Sequence[Line]) -> Iterator[Fact]:
    """Yield refusals of gateways, changes of the formation, the goal, and starts of processes."""
    for line in lines:
        robot = line["robot"]
        name = robot_name(robot) if isinstance(robot, int) else ""
        match line["kind"]:
            case "goal":
                yield Fact(line["t"], "goal reached", name, f"{called(name)} reached the goal")
            case "formation" if event_log.asked_by_leader(line) and line.get("side"):
                text = f"{called(name)} asked for the formation {line['side']} ({line.get('by')})"
                yield Fact(line["t"], "formation", name, text)
            case "restarted" | "peer_up" if name and line["t"] > 1.0 and line["kind"] == "restarted":
                yield Fact(line["t"], "start", name, f"{called(name)} was started again")
            case "refused" if name and line.get("reason") != "shut":
                text = f"the gateway of {called(name)} refused a command ({str(line.get('reason')).replace('_', ' ')})"
                yield Fact(line["t"], "deaf", name, text, other=str(line.get("reason")))
