"""Texts of a schedule, its trace and its violations."""

from __future__ import annotations

from lfa.deploy.analysis.verification.checker import Violation
from lfa.deploy.fuzz.network import Trace
from lfa.deploy.fuzz.schedules import Schedule

COLUMN = 30
SKIPPED = ("extends", "hello", "grant", "nack")
"""Prefixes of frequent trace lines that explain little; `propose` is printed for a term's first rounds only."""


def columns(lines: list[str], schedule: Schedule) -> Trace:
    """Return a trace that appends to `lines`: time [ms], then one column for the witness and one for each robot."""
    ids = range(schedule.robots + len(schedule.spares) + 1)
    lines.append("      ms  " + "".join(f"{'witness' if i == 0 else f'robot{i}':<{COLUMN}}" for i in ids).rstrip())

    def trace(at: float, who: int, what: str) -> None:
        if not what.startswith(SKIPPED) and not (what.startswith("propose") and " r" in what and " r0" not in what):
            lines.append(f"{at * 1000.0:8.1f}  {' ' * (COLUMN * who)}{what}")

    return trace


def describe(schedule: Schedule) -> str:
    """Return a schedule as text: the link conditions in one line, then one line for each fault."""
    radio = schedule.radio
    head = f"{schedule.robots} robots, witness {schedule.witness}, {schedule.profile}, delay <= {radio.prompt_s:g} s"
    if schedule.operator_timeout_s is not None:
        head += f", stands {schedule.operator_timeout_s:.3f} s after its operator's last order"
    lines = [f"{head}, loss {radio.loss}, duplicate {radio.duplication}, tail {radio.tail}"]
    for fault in schedule.faults:
        targets = ", ".join("leader" if t < 0 else str(t) for t in fault.targets)
        lines.append(f"{fault.at * 1000.0:8.1f}  {fault.kind} {targets} ({fault.duration_s:.3f} s, {fault.value:.2f})")
    for trick in schedule.tricks:
        targets = ", ".join(map(str, trick.targets))
        lines.append(f"{trick.at * 1000.0:8.1f}  {trick.kind} {targets} ({trick.duration_s:.3f} s, {trick.value:g})")
    for call in schedule.rosters:
        place = f" for {call.value:.0f}" if call.value else ""
        lines.append(f"{call.at * 1000.0:8.1f}  {call.kind} {call.targets[0]}{place} (within {call.duration_s:.3f} s)")
    for call in schedule.stops:
        lines.append(f"{call.at * 1000.0:8.1f}  operator at {call.targets[0]}: {call.kind} ({call.duration_s:.3f} s)")
    for held in schedule.held:
        late = "is lost" if held.by_s is None else f"comes {held.by_s:g} s late"
        lines.append(f"message {held.number} from the first fault on {late}")
    return "\n".join(lines)


def said(violation: Violation) -> str:
    """Return a violation as one line of text."""
    return f"{violation.name} at {violation.at:.4f} s: {violation.text}"
