"""Rows of a bench: measured value and bar, measured by several processes, printed as a table or JSON."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from fnmatch import fnmatchcase
from functools import partial
from math import isfinite
from typing import Any, Literal

from msgspec import Struct, structs

from lfa.deploy.process.worker_pool import workers
from lfa.protocol.errors import Refused
from lfa.protocol.output import write_line

NEAR = 0.10
SAME = 0.01
FOLLOWS_MIN = 0.9
"""Minimum amplification of a chain whose robots follow."""
NEAR_FLOOR = 0.02
"""Minimum tolerance of the rule "near"; reference amplitude ratios have two decimals."""
ROUNDED = 6
"""Number of significant digits of a printed value."""
Rule = Literal["at most", "at least", "near", "same", "no worse"]


class Quantity(Struct, frozen=True):
    """Quantity that a case measures; without a bar it is only reported."""

    name: str
    unit: str
    bar: float | None = None
    rule: Rule = "at most"
    over: Literal["sum", "mean"] = "sum"
    """Value of a case in several parts, from those of its parts."""


class CasePart(Struct, frozen=True):
    """Part of a case that can be measured alone, with the facts that tell it from others in a kept result."""

    facts: Any
    measure: Callable[[], Sequence[float]]


class Case(Struct, frozen=True):
    """One run and its quantities; `measure` returns one value per quantity and must be picklable."""

    name: str
    quantities: tuple[Quantity, ...]
    measure: Callable[[], Sequence[float]]
    parts: tuple[CasePart, ...] = ()
    """Parts whose values make the case's; empty: it is measured as a whole."""

    def row_names(self) -> list[str]:
        """Return the names of the case's rows, one per quantity."""
        return [f"{self.name}/{quantity.name}" for quantity in self.quantities]


def many(name: str, quantities: tuple[Quantity, ...], parts: Sequence[CasePart]) -> Case:
    """Return a case of several parts, such as one for each seed."""
    return Case(name, quantities, partial(_measure_all, quantities, tuple(parts)), tuple(parts))


def _measure_all(quantities: Sequence[Quantity], parts: Sequence[CasePart]) -> list[float]:
    return combined(quantities, [part.measure() for part in parts])


def combined(quantities: Sequence[Quantity], values: Sequence[Sequence[float]]) -> list[float]:
    """Return the values of a case from those of its parts, of which there is at least one."""
    columns = zip(quantities, zip(*values, strict=True), strict=True)
    return [sum(column) / (len(column) if quantity.over == "mean" else 1) for quantity, column in columns]


class BenchRow(Struct, frozen=True):
    """One printed row: measured value, bar and result."""

    name: str
    value: float
    unit: str
    bar: float | None
    ratio: float | None
    """Value divided by the bar; None without a bar or with a bar of 0."""
    ok: bool


def row(case: str, quantity: Quantity, value: float) -> BenchRow:
    """Return the row of a measured value; a value that is not finite never passes."""
    bar = quantity.bar
    value = float(f"{value:.{ROUNDED}g}")
    ratio = None if not bar else float(f"{value / bar:.4g}")
    return BenchRow(
        f"{case}/{quantity.name}", value, quantity.unit, bar, ratio, isfinite(value) and _holds(quantity, value)
    )


def _holds(quantity: Quantity, value: float) -> bool:
    bar = quantity.bar
    if bar is None:
        return True
    if quantity.rule == "at least":
        return value >= bar
    if quantity.rule == "same":
        return abs(value - bar) <= SAME * bar
    if quantity.rule == "no worse":
        return FOLLOWS_MIN <= value <= (1.0 + NEAR) * bar
    if quantity.rule == "near":
        return abs(value - bar) <= max(NEAR * bar, NEAR_FLOOR)
    return value <= bar


def select(cases: Sequence[Case], glob: str) -> list[Case]:
    """Return the cases with a row whose name matches `glob`. Raises `Refused` if there is none."""
    chosen = [case for case in cases if any(fnmatchcase(name, glob) for name in case.row_names())]
    if not chosen:
        groups = sorted({case.name.split("/")[0] for case in cases})
        raise Refused(f"--rows {glob!r}: no row has such a name; they begin with {', '.join(groups)}")
    return chosen


def measured(cases: Sequence[Case], jobs: int, glob: str = "*") -> Iterator[list[BenchRow]]:
    """Yield the matching rows of each case, in the order of the cases, as soon as they are measured."""
    if jobs <= 1 or len(cases) == 1:
        for case in cases:
            yield _matching(case, case.measure(), glob)
        return
    with workers(jobs) as pool:
        waiting = [pool.submit(case.measure) for case in cases]
        for case, future in zip(cases, waiting, strict=True):
            yield _matching(case, future.result(), glob)


def _matching(case: Case, values: Sequence[float], glob: str) -> list[BenchRow]:
    rows = (row(case.name, quantity, value) for quantity, value in zip(case.quantities, values, strict=True))
    return [row for row in rows if fnmatchcase(row.name, glob)]


def show(rows: Iterator[list[BenchRow]], as_json: bool) -> int:
    """Print the rows, one by one (table) or at the end (JSON); return 0 if every row holds, else 1.

    After Ctrl-C print what is measured so far, say so, and raise KeyboardInterrupt.
    """
    done: list[BenchRow] = []
    try:
        for some in rows:
            done += some
            if not as_json:
                for one in some:
                    print(line(one), flush=True)
    except KeyboardInterrupt:
        if as_json:
            print(json.dumps({"rows": [structs.asdict(one) for one in done], "interrupted": True}))
        write_line(f"interrupted: {len(done)} rows are complete", sys.stderr)
        raise
    if as_json:
        print(json.dumps({"rows": [structs.asdict(one) for one in done]}))
    failed = [one.name for one in done if not one.ok]
    if not as_json:
        print(f"{len(done)} rows, {len(failed)} below the bar" + "".join(f"\n  {name}" for name in failed))
    return 1 if failed else 0


def line(one: BenchRow) -> str:
    """Return a row as one line of the table."""
    bar = "-" if one.bar is None else f"{one.bar:g}"
    mark = "ok" if one.ok else "BELOW THE BAR"
    return f"{one.name:<52}{one.value:>12.5g} {one.unit:<6} bar {bar:>8}  {mark}"
