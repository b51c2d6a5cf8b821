"""`lfa bench control`: the formation controller against the bars of control.md, sections 5.4 and 6."""

from __future__ import annotations

from itertools import chain
from pathlib import Path

from lfa.deploy.bench.control_cases import agents, string_stability, table
from lfa.deploy.bench.control_cases import figures as control_figures
from lfa.deploy.bench.harness.rows import Case, measured, select, show


def cases() -> list[Case]:
    """The longest first, so that two jobs end together."""
    return [*string_stability.cases(), *agents.cases(), *table.cases()]


def run(as_json: bool, rows: str = "*", jobs: int = 2, processes: bool = False, figures: str | None = None) -> int:
    """0 when every chosen row holds, else 1. `rows` is a glob over row names, `figures` a folder to draw into.

    `processes` adds real runs, one after the other and alone: beside a computation they would show its load.
    """
    virtual, live = cases(), agents.process_cases() if processes else []
    chosen = select([*virtual, *live], rows)
    computed = [case for case in chosen if case not in live]
    alone = [case for case in chosen if case in live]
    if figures is not None:
        control_figures.draw(Path(figures))
    return show(chain(measured(computed, jobs, rows), measured(alone, 1, rows)), as_json)
