"""Merged checks of runs, of `lfa verify` and `lfa bench paper`: each run with what fails in it."""

from __future__ import annotations

from lfa.deploy.campaign.combine import Combined
from lfa.deploy.campaign.merge.files import ResultTable
from lfa.deploy.campaign.merge.page import Section, rows, tiles
from lfa.deploy.campaign.merge.report import MergeReport


def report(combined: Combined) -> MergeReport:
    """Return the merged checks: a row for each run."""
    results = list(combined.results.values())
    names = [str(result.data["scenario"]) for result in results]
    seeds = [int(result.data["seed"]) for result in results]
    complaints = [result.complaint for result in results]
    failed = sum(map(bool, complaints))
    body = [(*row[:2], row[2] or "ok") for row in zip(names, seeds, complaints, strict=True)]
    table = ResultTable({"scenario": [*names], "seed": [*seeds], "fails": [*complaints]})
    sections = (
        Section("Summary", tiles((("runs", len(results)), ("failed", failed)))),
        Section("Runs", rows(("scenario", "seed", "result"), body, text=(0,), long=2)),
    )
    lines = tuple(f"{scenario}, seed {seed}: {said}" for scenario, seed, said in body)
    return MergeReport(lines, table, sections, failed)
