"""What a merge says of one kind of campaign, and how it is written: in the terminal, as files and as a page."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from msgspec import Struct

from lfa.deploy.campaign.combine import Combined
from lfa.deploy.campaign.merge.files import ResultTable, write_file, write_table
from lfa.deploy.campaign.merge.page import Section, page

PAGE = "index.html"


class MergeReport(Struct, frozen=True):
    """A merged campaign."""

    lines: tuple[str, ...]
    """Table for the terminal."""
    table: ResultTable
    sections: tuple[Section, ...]
    failed: int
    """Number of items that are not good."""
    worst: tuple[str, ...] = ()
    """Names of the items, the worst first, whose folders the page links to: `worst/<name>`."""


Report = Callable[[Combined], MergeReport]


def written(combined: Combined, report: MergeReport, out: Path) -> Mapping[str, Path]:
    """Write page, CSV and Parquet into the folder `out`; return their paths by kind. Raises Refused."""
    table = write_table(out, report.table)
    campaign = combined.campaign
    missing = f"{combined.missing} of {len(campaign.names)} items are missing" if combined.missing else ""
    text = page(campaign.title, f"{campaign.kind}, {campaign.lfa}, plan {campaign.plan}", missing, report.sections)
    write_file(out / PAGE, text.encode())
    return {"csv": table[0], "parquet": table[1], "page": out / PAGE}
