"""Comparison of a measured value with its bar, and its output line of `lfa verify`."""

from __future__ import annotations

from math import isfinite
from typing import Literal

from msgspec import Struct

Status = Literal["ok", "fails", "does not apply", "needs more runs"]
NOTE_MAX = 160


class Measured(Struct, frozen=True):
    """Measured value of a property; nan when the property does not apply, which is not a failure."""

    value: float
    note: str = ""
    """Source of the value, or what is missing."""


class Finding(Struct, frozen=True):
    """Result of one property. `value` is None when there was nothing to measure."""

    figure: str
    """Figure of the paper: 7, 8, 9 or 11; `run` for properties that all figures need."""
    name: str
    status: Status
    value: float | None
    unit: str
    bar: str
    note: str = ""


class Bar(Struct, frozen=True):
    """Bound of one property: figure, name, comparison and limit with its unit."""

    figure: str
    name: str
    rule: Literal["<", "<=", ">=", "=", ">"]
    bar: float
    unit: str = ""

    def judged(self, measured: Measured | None) -> Finding:
        """Compare a value with the bar and return the finding; None as value gives `needs more runs`."""
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
    """Format a finding as one row of a table."""
    value = "-" if one.value is None else f"{one.value:.4g}"
    return f"  {one.figure:<4}{one.name:<48}{value:>10} {one.unit:<4} bar {one.bar:<11} {one.status}" + (
        f"  ({one.note})" if one.note else ""
    )
