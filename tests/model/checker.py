"""Every state that a small model can reach, breadth first, whole states stored: the first violation is a shortest one.

A model is anything with `columns`, `initial()` and `successors(state)`. States are hashable and compared as a whole:
there is no hashing to fewer bits that could lose one.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from time import process_time
from typing import Protocol

State = bytes
COLUMN_WIDTH = 34


@dataclass(frozen=True)
class Step:
    """What happened, in the words of the protocol, and in whose column it stands; None: everywhere (time)."""

    column: int | None
    text: str


Successor = tuple[tuple[object, ...], State, str | None]
"""(what happened, the state after it, which invariant that breaks or None)"""


class Model(Protocol):
    @property
    def columns(self) -> tuple[str, ...]: ...
    def initial(self) -> State: ...
    def successors(self, state: State) -> Iterable[Successor]: ...
    def step(self, event: tuple[object, ...]) -> Step: ...


@dataclass(frozen=True)
class Outcome:
    states: int
    depth: int
    """Length of the longest shortest path; of the counter-example, when there is one."""
    seconds: float
    """Of one core."""
    complete: bool
    """Nothing was left out: False when `states_max` or `depth_max` ended the search."""
    violation: str | None
    trace: tuple[Step, ...]


def explore(model: Model, states_max: int, depth_max: int | None = None) -> Outcome:
    """All reachable states, up to the first violation or a bound."""
    began = process_time()
    start = model.initial()
    parent: dict[State, State | None] = {start: None}
    frontier, depth, bounded = [start], 0, False
    while frontier:
        if depth_max is not None and depth >= depth_max:
            bounded = True
            break
        depth += 1
        following: list[State] = []
        for state in frontier:
            for event, after, violation in model.successors(state):
                if violation is not None:
                    trace = (*_path(model, parent, state), model.step(event))
                    return Outcome(len(parent), depth, process_time() - began, False, violation, trace)
                if after not in parent:
                    parent[after] = state
                    following.append(after)
        frontier = following
        if len(parent) > states_max:
            bounded = True
            break
    return Outcome(len(parent), depth, process_time() - began, not bounded, None, ())


def _path(model: Model, parent: dict[State, State | None], state: State) -> list[Step]:
    """The steps from the start to `state`: only states are stored, so each step is found again among successors."""
    steps: list[Step] = []
    before = parent[state]
    while before is not None:
        event = next(event for event, after, _ in model.successors(before) if after == state)
        steps.append(model.step(event))
        state, before = before, parent[before]
    return steps[::-1]


def in_columns(columns: tuple[str, ...], outcome: Outcome) -> str:
    """The counter-example, one line a step, each in the column of who took it."""
    lines = ["     " + "".join(name.ljust(COLUMN_WIDTH) for name in columns).rstrip()]
    for number, step in enumerate(outcome.trace, 1):
        if step.column is None:
            cells = f"-- {step.text} ".ljust(COLUMN_WIDTH * len(columns), "-")
        else:
            cells = " " * (COLUMN_WIDTH * step.column) + step.text
        lines.append(f"{number:4} {cells}".rstrip())
    return "\n".join([*lines, f"     => {outcome.violation}"])
