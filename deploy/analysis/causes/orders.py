"""Orders that an operator gave during a run, and the times without an operator, from the recording."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec

from lfa.agents.orders.roster_orders import JOIN, RETIRE
from lfa.deploy.analysis.causes.effects import ASIDE
from lfa.deploy.analysis.causes.fact import Fact, called
from lfa.deploy.recording import mcap_reader
from lfa.protocol.mission import Mission
from lfa.protocol.names import robot_id_of, robot_name
from lfa.protocol.topics import OPERATOR_NAME

ROUTE = ("route_m", "times_s", "orientations")


def facts(folder: Path, mission: Mission) -> Iterator[Fact]:
    """Yield each order of an operator, a repeated word once, and each time without an operator (E31).

    What only simulates a fault is no order.
    """
    said: set[tuple[object, ...]] = set()
    mark: tuple[object, ...]
    holds: dict[str, Any] | None = None
    heard_s: float | None = None
    for owner, topic, t, note in mcap_reader.messages(folder, frozenset({"operator", "stop", "team_order"})):
        place, words, mark = owner, "", (note.header.incarnation, topic)
        if topic == "stop":
            yield from _silence(owner, heard_s, t, mission.operator_timeout_s)
            heard_s = t
            if note.word is not None:
                words, mark = "stop" if note.word.stand else "resume", (topic, note.word.epoch, note.word.stand)
        elif topic == "operator" and note.command not in ASIDE:
            words, mark = note.command, (*mark, note.header.seq)
            robot = note.arguments.get("robot")
            if note.command in (JOIN, RETIRE) and isinstance(robot, int):
                place = robot_name(robot)
                words, mark = f"{note.command} {called(place)}", (note.header.incarnation, robot, note.command)
        elif topic == "team_order":
            order = msgspec.to_builtins(note.order)
            words = "" if robot_id_of(owner) or holds is None else _changes(holds, order)
            holds, mark = order, (*mark, note.order.version)
        if words and mark not in said:
            said.add(mark)
            evidence = f"{topic} {note.header.seq} of {note.header.sender}"
            kind = "goal" if words.startswith("go ") else words.partition(" ")[0]
            yield Fact(t, "order", place, f"an operator ordered: {words}", other=kind, evidence=evidence)
    yield from _silence(OPERATOR_NAME, heard_s, None, mission.operator_timeout_s)


def _silence(owner: str, heard_s: float | None, t: float | None, timeout_s: float | None) -> Iterator[Fact]:
    """Yield the time without an operator up to `t` [s], or the run's end, if it is longer than the mission allows."""
    if heard_s is not None and timeout_s is not None and (t is None or t - heard_s > timeout_s):
        text = f"no operator had been heard for {timeout_s:g} s"
        yield Fact(heard_s + timeout_s, "order", owner, text, until_s=t, other="silence")


def _changes(before: dict[str, Any], after: dict[str, Any]) -> str:
    """Return in the commands' words by what an order differs from the one that holds; empty if by nothing."""
    was, now = before["leading"], after["leading"]
    if after["paused"] and not before.get("paused", False):
        return "pause"
    if [was[key] for key in ROUTE] != [now[key] for key in ROUTE]:
        x, y = now["route_m"][-1]
        return f"go {x:g} {y:g}"
    parts = ((was, now), (before["formation"], after["formation"]))
    changed = [f"{key}={new[key]}" for old, new in parts for key in new if new[key] != old[key]]
    if changed:
        return f"set {' '.join(changed)}"
    return "go" if before.get("paused", False) and not after["paused"] else ""
