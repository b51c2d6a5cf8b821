"""`lfa bench control`: the formation controller against the bars of control.md, sections 5.4 and 6."""

from __future__ import annotations

from deploy.bench import control_string, control_table
from deploy.bench.rows import Case, measured, select, show


def cases() -> list[Case]:
    """The longest first, so that two jobs end together."""
    return [*control_string.cases(), *control_table.cases()]


def run(as_json: bool, rows: str = "*", jobs: int = 2) -> int:
    """0 when every chosen row holds, else 1. `rows` is a glob over row names."""
    return show(measured(select(cases(), rows), jobs, rows), as_json)
