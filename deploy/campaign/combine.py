"""Results of all shares of a campaign, joined: the same for any number of shares, in any order."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import msgspec
from msgspec import Struct

from lfa.deploy.campaign.folder import Campaign, CampaignFolder, StoredResult, read_description
from lfa.deploy.version import code_line
from lfa.protocol.errors import Refused


class Combined(Struct, frozen=True):
    """A campaign with the results that are there, in the order of its items."""

    campaign: Campaign
    results: dict[str, StoredResult]

    @property
    def missing(self) -> int:
        return len(self.campaign.names) - len(self.results)


def combine(folders: Sequence[Path]) -> Combined:
    """Return the results in all `folders`, which must be of one campaign and of this version.

    Raises Refused, also when two folders have different results of one item.
    """
    first, results, found_in = folders[0], dict[str, StoredResult](), dict[str, Path]()
    campaign = read_description(first)
    if campaign.lfa != code_line():
        raise Refused(f"{first}: of {campaign.lfa}, and this is {code_line()}: merge with the version that did it")
    for folder in folders:
        other = campaign if folder == first else read_description(folder)
        if (other.plan, other.lfa, other.kind) != (campaign.plan, campaign.lfa, campaign.kind):
            raise Refused(f"{folder}: another campaign ({other.title}, {other.lfa}) than {first}: must be of the same")
        for result in CampaignFolder(folder, campaign).results():
            known = results.setdefault(result.name, result)
            if msgspec.json.encode(known) != msgspec.json.encode(result):
                raise Refused(f"{folder}: {result.name} differs from that in {found_in[result.name]}")
            found_in.setdefault(result.name, folder)
    ordered = {name: results[name] for name in campaign.names if name in results}
    return Combined(campaign, ordered)
