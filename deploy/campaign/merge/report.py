"""What a merge says of one kind of campaign, and how it is written: in the terminal, as files and as a page."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from msgspec import Struct

from lfa.deploy.campaign.combine import Combined
from lfa.deploy.campaign.merge.files import ResultTable, write_table
from lfa.deploy.campaign.merge.page import Section, page
from lfa.deploy.whole_output import whole_folder

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
    """Write page, CSV and Parquet into the folder `out`, all or none; return their paths by kind. Raises OSError."""
    campaign = combined.campaign
    missing = f"{combined.missing} of {len(campaign.names)} items are missing" if combined.missing else ""
    text = page(campaign.title, f"{campaign.kind}, {campaign.lfa}, plan {campaign.plan}", missing, report.sections)
    with whole_folder(out) as fresh:
        csv, parquet = write_table(fresh, report.table)
        (fresh / PAGE).write_bytes(text.encode())
    return {"csv": out / csv, "parquet": out / parquet, "page": out / PAGE}
