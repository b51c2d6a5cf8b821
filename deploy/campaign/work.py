"""A campaign's share, done: the items whose results are missing, each stored as soon as it ends."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lfa.deploy.campaign.execute import execute
from lfa.deploy.campaign.folder import Campaign, CampaignFolder, open_folder
from lfa.deploy.campaign.items import Item, names_digest
from lfa.deploy.campaign.progress import CampaignProgress
from lfa.deploy.campaign.shard import WHOLE, Shard
from lfa.deploy.version import code_line
from lfa.protocol.errors import Refused
from lfa.protocol.output import write_line

LOST = "nothing is kept: with --out DIR the same command does the rest"


def campaign_of(kind: str, title: str, items: Sequence[Item], about: Any = None) -> Campaign:
    """Return the description of a campaign of these items, done by this version of the code."""
    names = [item.name for item in items]
    return Campaign(code_line(), kind, title, names_digest(names), tuple(names), about)


def do_share(
    folder: Path,
    campaign: Campaign,
    items: Sequence[Item],
    shard: Shard = WHOLE,
    jobs: int = 1,
    said: str = "runs",
    *,
    lasting: bool = True,
) -> tuple[CampaignFolder, int]:
    """Do the missing items of the share; return the folder and the number of items that failed or could not be done.

    After Ctrl-C, say how many are done and, of a `lasting` folder, where. Raises Refused, before anything is done, for
    a folder that does not belong to this campaign.
    """
    if jobs < 1:
        raise Refused(f"--jobs {jobs}: must be at least 1")
    kept = open_folder(folder, campaign)
    mine = shard.share(items)
    names = {item.name for item in mine}
    before = [result for result in kept.results() if result.name in names]
    there = {result.name for result in before}
    progress = CampaignProgress(len(mine), len(there), said)
    try:
        for finished in execute([item for item in mine if item.name not in there], jobs):
            if finished.result is not None:
                kept.store(finished.item.name, finished.result)
            complaint = finished.reason if finished.result is None else finished.result.complaint
            progress.step(finished.item.label, complaint)
    except KeyboardInterrupt:
        kept_where = f"they are in {folder}, and the same command does the rest"
        write_line(f"interrupted: {progress.counted()}; {kept_where if lasting else LOST}", sys.stderr)
        raise
    finally:
        progress.close()
    return kept, progress.failed + sum(bool(result.complaint) for result in before)
