"""`lfa campaign merge DIR...`: all shares of a campaign as one table, in the terminal, as files and as a page."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

import msgspec

from lfa.deploy.campaign.combine import Combined, combine
from lfa.deploy.campaign.merge.report import MergeReport, written
from lfa.deploy.terminal_text import print_visible
from lfa.protocol.errors import Refused
from lfa.protocol.output import visible, write_line

MERGED = "merged"
WORST = "worst"
REPORTS = {
    "sweep": "lfa.deploy.campaign.merge.sweep",
    "fuzz": "lfa.deploy.campaign.merge.fuzz",
    "bench": "lfa.deploy.campaign.merge.bench",
    "bench paper": "lfa.deploy.campaign.merge.findings",
    "verify": "lfa.deploy.campaign.merge.findings",
}
"""Module of each kind of campaign, with a function `report`."""


def merge(folders: Sequence[Path], out: Path | None, as_json: bool) -> int:
    """Merge the campaign in `folders` into `out`, by default `merged` in the first; return the exit code.

    It is 1 if an item is not good or is missing. Raises Refused.
    """
    combined = combine(folders)
    report = report_of(combined)
    place = out or folders[0] / MERGED
    try:
        paths = written(combined, report, place)
    except OSError as error:
        raise Refused(f"--out {place}: {error.strerror}: must be a folder to write to") from None
    _record_worst(combined, report, place)
    done, of = len(combined.results), len(combined.campaign.names)
    if as_json:
        facts = {"items": of, "done": done, "failed": report.failed, "missing": combined.missing}
        print_visible(msgspec.json.encode({**facts, **{kind: str(path) for kind, path in paths.items()}}).decode())
    else:
        print_visible("\n".join(map(visible, report.lines)))
        print_visible(
            f"{done} of {of} done, {report.failed} not good; {', '.join(str(path) for path in paths.values())}"
        )
    if combined.missing:
        write_line(f"{combined.missing} of {of} are missing: start the campaign again to do them", sys.stderr)
    return 1 if report.failed or combined.missing else 0


def report_of(combined: Combined) -> MergeReport:
    """Return the report on a combined campaign, by its kind.

    Raises Refused for a kind without a report, and for a description or results that are not those of the kind.
    """
    module = REPORTS.get(combined.campaign.kind)
    if module is None:
        raise Refused(f"a campaign of the kind {combined.campaign.kind}: must be one of {', '.join(REPORTS)}")
    try:
        found: MergeReport = import_module(module).report(combined)
    except (msgspec.ValidationError, LookupError, TypeError) as error:
        kind = combined.campaign.kind
        raise Refused(f"campaign.json or a result is damaged ({error}): must be those of a {kind}") from error
    return found


def _record_worst(combined: Combined, report: MergeReport, place: Path) -> None:
    """Do the worst runs once more, recorded whole, where an earlier merge has not."""
    for name in report.worst:
        folder = place / WORST / name
        if not (folder / "summary.json").is_file():
            import_module(REPORTS[combined.campaign.kind]).record(combined, name, folder)
