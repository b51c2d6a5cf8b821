"""`lfa bench control`: the formation controller against the bars of control.md, sections 5.4 and 6."""

from __future__ import annotations

from itertools import chain
from pathlib import Path

from lfa.deploy.bench.control_cases import agents, string_stability, table
from lfa.deploy.bench.control_cases.figures import draw
from lfa.deploy.bench.harness.kept import Keep, measured_or_kept
from lfa.deploy.bench.harness.rows import Case, measured, select, show


def cases() -> list[Case]:
    """Return all cases in virtual time, the longest first, so that parallel jobs end at about the same time."""
    return [*string_stability.cases(), *agents.cases(), *table.cases()]


def run(
    as_json: bool,
    rows: str = "*",
    jobs: int = 2,
    processes: bool = False,
    figures: str | None = None,
    keep: Keep | None = None,
) -> int:
    """Print the rows whose names match the glob `rows`; return 0 if all hold, else 1. `figures` is an output folder.

    `processes` adds real runs, one after the other and after the computations, whose load would distort them.
    """
    virtual, live = cases(), agents.process_cases() if processes else []
    chosen = select([*virtual, *live], rows)
    computed = [case for case in chosen if case not in live]
    alone = [case for case in chosen if case in live]
    if figures is not None:
        draw(Path(figures))
    return show(chain(measured_or_kept("control", computed, jobs, rows, keep), measured(alone, 1, rows)), as_json)
