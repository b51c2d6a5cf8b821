"""Merged fuzz search: what was played, and each violation with its seed and its shrunk schedule."""

from __future__ import annotations

from html import escape

from lfa.deploy.campaign.combine import Combined
from lfa.deploy.campaign.merge.files import ResultTable
from lfa.deploy.campaign.merge.page import Section, rows, tiles
from lfa.deploy.campaign.merge.report import MergeReport
from lfa.deploy.fuzz.schedules import KINDS
from lfa.deploy.fuzz.search import systematic
from lfa.deploy.fuzz.search.searches import Tally
from lfa.deploy.fuzz.search.shares import tally_of

SHOWN_MAX = 100


def report(combined: Combined) -> MergeReport:
    """Return the merged search."""
    tally = Tally()
    for result in combined.results.values():
        tally.add(tally_of(result.data))
    found = [one for result in combined.results.values() for one in result.data["found"]]
    faults = [(kind, tally.faults.get(kind, 0)) for kind in KINDS]
    lines = [f"seed {one['seed']}: {one['says']}  reproduce: {one['again']}" for one in found[:SHOWN_MAX]]
    lines.append(f"{tally.seeds} schedules, {tally.elections} elections, {len(tally.failed)} failed")
    totals = (("schedules", tally.seeds), ("elections", tally.elections), ("failed", len(tally.failed)))
    shown = "".join(
        f"<h3>Seed {one['seed']}: {escape(one['says'])}</h3><p><code>{escape(one['again'])}</code></p>"
        f"<pre>{escape(one['shrunk'])}</pre>"
        for one in found[:SHOWN_MAX]
    )
    seeds = sorted(tally.failed)
    table = ResultTable({"seed": [*seeds], "violations": ["; ".join(tally.failed[seed]) for seed in seeds]})
    about = combined.campaign.about
    covered = systematic.covered(range(about["first"], about["last"] + 1)) if about["kind"] == "systematic" else []
    lines += covered if combined.missing == 0 else []
    sections = (
        Section("Summary", tiles(totals) + "".join(f"<p>{escape(line)}</p>" for line in covered)),
        Section("Violations", shown or "<p>None.</p>"),
        Section("Faults that took effect", rows(("kind", "number"), faults, text=(0,))),
    )
    return MergeReport(tuple(lines), table, sections, len(tally.failed))
