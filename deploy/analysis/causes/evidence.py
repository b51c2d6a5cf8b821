"""Failures that a run's messages prove: processes that died or stood still, links that lost, hardware that fell silent.

Pure functions of a `RunTrace`.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from lfa.deploy.analysis.causes.fact import Fact, called
from lfa.deploy.analysis.causes.link_losses import losses
from lfa.deploy.analysis.causes.run_trace import STALL_S, ProcessTrace, RunTrace
from lfa.protocol.names import WITNESS_NAME
from lfa.protocol.topics import TOPIC, WORLD_NAME

TOKEN_S = 1.0
"""Time [s] within which the token of a dead process vanishes at another one."""
SILENT_FACTOR = 1.5
"""Least silence of a robot's hardware, in timeouts of the topic."""
SILENT_S_MIN = 0.35


def failures(trace: RunTrace) -> list[Fact]:
    """Return the failures and orderly ends of a run, by time."""
    found = [*_ends(trace), *_stalls(trace)]
    standing = {fact.place: fact for fact in found if fact.kind == "stalled"}
    found += _own(list(_silences(trace, standing.get(WORLD_NAME))))
    found += losses(trace)
    return sorted(found, key=lambda fact: fact.at_s)


# --- processes -------------------------------------------------------------------------------------------------------


def _ends(trace: RunTrace) -> Iterator[Fact]:
    """Yield the processes that died or left before the run's end, and those that stood still until its end."""
    for process in trace.processes:
        said = trace.last.get((process.name, process.incarnation))
        last_s = max(process.last_s, 0.0 if said is None else said.at_s)
        if process.stopped_s is not None and process.stopped_s < trace.end_s - STALL_S:
            yield Fact(process.stopped_s, "left", process.name, f"{called(process.name)} was told to end, and left")
            continue
        if process.stopped_s is not None or last_s > trace.end_s - _idle_s(process):
            continue
        reborn = any(p.name == process.name and abs(p.first_s - last_s) < STALL_S for p in trace.processes)
        if reborn:
            continue
        vanished = _vanished(trace, process, last_s)
        proof = "no message" if said is None else f"last message {said.number[0]} {said.number[1]} at {said.at_s:.3f} s"
        if vanished is None and process.ticks_s:
            text = f"{called(process.name)} stood still and did not go on"
            yield Fact(last_s, "stalled", process.name, text, evidence=proof)
        else:
            seen = "" if vanished is None else f"; {vanished[1]} saw its token vanish at {vanished[0]:.3f} s"
            yield Fact(last_s, "died", process.name, f"{called(process.name)} died", evidence=proof + seen)


def _idle_s(process: ProcessTrace) -> float:
    """Return the time [s] that a process may be quiet: a witness is called by others only."""
    return 1.5 if process.name == WITNESS_NAME else STALL_S


def _vanished(trace: RunTrace, process: ProcessTrace, last_s: float) -> tuple[float, str] | None:
    """Return when and by whom the token of a process was first seen to vanish after its last word."""
    seen = [
        (at_s, other.name)
        for other in trace.processes
        for at_s, name, incarnation in other.vanished
        if (name, incarnation) == (process.name, process.incarnation) and last_s - 0.01 <= at_s <= last_s + TOKEN_S
    ]
    return min(seen, default=None)


def _stalls(trace: RunTrace) -> Iterator[Fact]:
    """Yield the intervals in which a process that ticks did not."""
    for process in trace.processes:
        if process.name == WITNESS_NAME:
            continue
        for before_s, after_s in pairwise(process.ticks_s[_warm(process) :]):
            if after_s - before_s >= STALL_S:
                text = f"{called(process.name)} stood still for {after_s - before_s:.2f} s"
                proof = f"no tick in its journal from {before_s:.3f} to {after_s:.3f} s"
                yield Fact(before_s, "stalled", process.name, text, after_s, evidence=proof)


def _warm(process: ProcessTrace) -> int:
    """Return the number of the first tick that counts: a process that waits for its mission ticks seldom."""
    for number in range(len(process.ticks_s) - 10):
        if process.ticks_s[number + 10] - process.ticks_s[number] < STALL_S:
            return number
    return len(process.ticks_s)


# --- hardware --------------------------------------------------------------------------------------------------------

_PART = {"sensors": "driver", "localization": "localization", "scan": "scanner", "ground": "ground sensor"}


def _silences(trace: RunTrace, world: Fact | None) -> Iterator[Fact]:
    """Yield the intervals in which a part of a robot's hardware sent nothing while the world went on."""
    ends_s = trace.truth_s[-1] if trace.truth_s else trace.end_s
    for robot, topic in sorted(trace.hardware):
        times = trace.hardware[robot, topic]
        timeout_s = max(SILENT_FACTOR * (TOPIC[topic].timeout_s or 0.0), SILENT_S_MIN)
        for before_s, after_s in pairwise([*times, ends_s]):
            if after_s - before_s < timeout_s or (world is not None and _within(world, before_s, after_s)):
                continue
            part = _PART[topic]
            lasting = "" if after_s == ends_s else f" for {after_s - before_s:.2f} s"
            text = f"the {part} of {called(robot)} fell silent{lasting}"
            proof = f"no {topic} in the recording after {before_s:.3f} s"
            until_s = None if after_s == ends_s else after_s
            yield Fact(before_s, "hardware silent", robot, text, until_s, part, proof)


def _own(silences: list[Fact]) -> list[Fact]:
    """Return the silences without those of sensors whose robot's driver fell silent with them: it reads them all."""
    drivers = [fact for fact in silences if fact.other == "driver"]
    return [
        fact
        for fact in silences
        if fact.other == "driver"
        or not any(
            driver.place == fact.place and _about(driver.at_s, fact.at_s) and _about(driver.until_s, fact.until_s)
            for driver in drivers
        )
    ]


def _about(one_s: float | None, other_s: float | None) -> bool:
    """Return True for times [s] that are the same but for a period of a sensor; None: the end of the run."""
    if one_s is None or other_s is None:
        return one_s == other_s
    return abs(one_s - other_s) < STALL_S


def _within(fact: Fact, from_s: float, until_s: float) -> bool:
    return fact.at_s < until_s and (fact.until_s is None or fact.until_s > from_s)
