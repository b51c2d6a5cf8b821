"""A value beside the bar that it has to reach, as `lfa verify` prints it."""

from __future__ import annotations

from math import isfinite
from typing import Literal

from msgspec import Struct

Status = Literal["ok", "fails", "does not apply", "needs more runs"]
NOTE_MAX = 160


class Measured(Struct, frozen=True):
    """A value to be judged; nan: there was nothing of the kind, which is no fault."""

    value: float
    note: str = ""
    """Where the value is from, or what is missing."""


class Finding(Struct, frozen=True):
    """One property. `value` is None where there was nothing to judge."""

    figure: str
    """7, 8, 9 or 11: the paper's; `run` for what all of them need."""
    name: str
    status: Status
    value: float | None
    unit: str
    bar: str
    note: str = ""


class Bar(Struct, frozen=True):
    figure: str
    name: str
    rule: Literal["<", "<=", ">=", "=", ">"]
    bar: float
    unit: str = ""

    def judged(self, measured: Measured | None) -> Finding:
        """`None`: it takes more runs to say."""
        shown = f"{self.rule} {self.bar:g} {self.unit}".rstrip()
        if measured is None:
            return Finding(self.figure, self.name, "needs more runs", None, self.unit, shown)
        note = measured.note if len(measured.note) <= NOTE_MAX else f"{measured.note[: NOTE_MAX - 3]}..."
        if not isfinite(measured.value):
            return Finding(self.figure, self.name, "does not apply", None, self.unit, shown, note)
        status: Status = "ok" if self._holds(measured.value) else "fails"
        return Finding(self.figure, self.name, status, float(f"{measured.value:.4g}"), self.unit, shown, note)

    def _holds(self, value: float) -> bool:
        holds = {"<": value < self.bar, "<=": value <= self.bar, ">": value > self.bar, ">=": value >= self.bar}
        return holds.get(self.rule, value == self.bar)


def line(one: Finding) -> str:
    """One row of a table."""
    value = "-" if one.value is None else f"{one.value:.4g}"
    return f"  {one.figure:<4}{one.name:<48}{value:>10} {one.unit:<4} bar {one.bar:<11} {one.status}" + (
        f"  ({one.note})" if one.note else ""
    )
