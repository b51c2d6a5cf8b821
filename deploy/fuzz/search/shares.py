"""A fuzz search as a campaign: chunks of seeds, done in shares, resumed, and merged.

A chunk shrinks what it finds on the spot, so the merged page has the seed and the schedule of each violation.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import msgspec

from lfa.deploy.campaign.folder import CampaignFolder
from lfa.deploy.campaign.items import Item, ItemResult, name_of
from lfa.deploy.campaign.shard import Shard
from lfa.deploy.campaign.work import campaign_of, do_share
from lfa.deploy.fuzz.search.searches import Search, Tally, again, explain, play_part

KIND = "fuzz"
SHRUNK_MAX = 3
"""Number of failed seeds of a chunk that are shrunk: shrinking plays hundreds of schedules."""


def do_fuzz(seeds: range, search: Search, out: Path, shard: Shard, jobs: int) -> tuple[CampaignFolder, Tally]:
    """Do the share of the search; return the folder and the sum of all results in it. Raises Refused."""
    chunk = search.chunk
    parts = [seeds[start : start + chunk] for start in range(0, len(seeds), chunk)]
    items = [_item(part, search) for part in parts]
    campaign = campaign_of(
        KIND, f"lfa fuzz {search.options}--seeds {seeds[0]}..{seeds[-1]}", items, facts_of(seeds, search)
    )
    kept, _ = do_share(out, campaign, items, shard, jobs, "chunks")
    tally = Tally()
    for result in kept.results():
        tally.add(tally_of(result.data))
    return kept, tally


def facts_of(seeds: range, search: Search) -> dict[str, object]:
    """Return what a merge needs of a search."""
    return {"kind": search.kind, "first": seeds[0], "last": seeds[-1]}


def tally_of(data: object) -> Tally:
    """Return the sum that a stored result holds."""
    assert isinstance(data, dict)
    return msgspec.convert(data["tally"], Tally, str_keys=True, strict=False)


def _item(seeds: range, search: Search) -> Item:
    name = name_of([KIND, search.options, seeds[0], seeds[-1]])
    return Item(name, f"seeds {seeds[0]}..{seeds[-1]}", partial(done, seeds, search))


def done(seeds: range, search: Search) -> ItemResult:
    """Play a chunk of seeds; each violation comes with its command and its shrunk schedule."""
    tally = play_part((seeds, search))
    found = [
        {"seed": seed, "says": tally.failed[seed][0], "again": again(seed, search), "shrunk": explain(seed, search)}
        for seed in sorted(tally.failed)[:SHRUNK_MAX]
    ]
    complaint = "; ".join(f"seed {one['seed']}: {one['says']}  reproduce: {one['again']}" for one in found)
    return ItemResult({"tally": msgspec.to_builtins(tally, str_keys=True), "found": found}, complaint)
