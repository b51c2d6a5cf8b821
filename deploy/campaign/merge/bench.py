"""Merged bench: the rows of every case whose parts are all there, each value beside its bar."""

from __future__ import annotations

from lfa.deploy.bench.harness.kept import rows_of
from lfa.deploy.bench.harness.rows import line
from lfa.deploy.campaign.combine import Combined
from lfa.deploy.campaign.merge.files import ResultTable
from lfa.deploy.campaign.merge.page import Section, rows
from lfa.deploy.campaign.merge.report import MergeReport


def report(combined: Combined) -> MergeReport:
    """Return the merged bench."""
    done = [one for case in rows_of(combined) for one in case]
    failed = [one for one in done if not one.ok]
    table = ResultTable(
        {
            "row": [one.name for one in done],
            "value": [one.value for one in done],
            "unit": [one.unit for one in done],
            "bar": [one.bar for one in done],
            "ok": [one.ok for one in done],
        }
    )
    body = [(one.name, f"{one.value:.5g}", one.unit, "–" if one.bar is None else f"{one.bar:g}",
             "ok" if one.ok else "below the bar") for one in done]  # fmt: skip
    sections = (Section("Rows", rows(("row", "value", "unit", "bar", "result"), body, text=(0, 2, 4))),)
    return MergeReport(tuple(map(line, done)), table, sections, len(failed))
