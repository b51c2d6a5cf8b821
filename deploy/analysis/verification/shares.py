"""`lfa verify` over many runs as a campaign: checked in shares, resumed, and merged."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import msgspec
from msgspec import Struct

from lfa.deploy.analysis.paper.across_seeds import Kept
from lfa.deploy.analysis.summary import SUMMARY
from lfa.deploy.campaign.items import Item, ItemResult, name_of
from lfa.deploy.campaign.shard import Shard
from lfa.deploy.campaign.work import campaign_of, do_share
from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import DamagedFile, read_bytes

KIND = "verify"

Check = Callable[[Path], tuple[Struct, Kept, str]]
"""Function of a run folder: its findings (with `scenario` and `seed`), what is kept of it, and what fails in it."""


def check_share(folders: Sequence[Path], check: Check, out: Path, shard: Shard, jobs: int) -> list[dict[str, object]]:
    """Check the share of the runs; return findings and kept data of all that are done, in the order of `folders`.

    Raises Refused for a folder that is no finished run.
    """
    items = [
        Item(name_of([KIND, _summary_hash(folder)]), str(folder), partial(_done, check, folder)) for folder in folders
    ]
    kept, _ = do_share(out, campaign_of(KIND, f"lfa verify, {len(items)} runs", items), items, shard, jobs)
    return [result.data for result in kept.results()]


def _summary_hash(folder: Path) -> str:
    """Return the hash of a run's summary, which names the run wherever its folder lies."""
    try:
        return hashlib.sha256(read_bytes(folder / SUMMARY)).hexdigest()
    except (OSError, DamagedFile):
        raise Refused(f"{folder}: no {SUMMARY}, must be the folder of a run that came to its end") from None


def _done(check: Check, folder: Path) -> ItemResult:
    findings, kept, complaint = check(folder)
    data = {**msgspec.to_builtins(findings), "kept": msgspec.to_builtins(kept)}
    return ItemResult(data, complaint)
