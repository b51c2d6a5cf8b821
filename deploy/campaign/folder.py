"""Folder of a campaign: a description, and one file for each item that was done, written in one step.

```
campaign.json            the version of lfa, the kind, and the hash of the plan
results/<name>.json      the result of one item; there if and only if the item was done to its end
```
"""

from __future__ import annotations

import os
import socket
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct

from lfa.deploy.campaign.items import ItemResult
from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import DamagedFile, read_given_json, read_json
from lfa.protocol.output import replace_file

DESCRIPTION = "campaign.json"
RESULTS = "results"
DESCRIPTION_BYTES_MAX = 256 * 1024 * 1024


class Campaign(Struct, frozen=True):
    """Description of a campaign, equal in all of its shares."""

    lfa: str
    """Version of the code that does the items (`version.code_line`)."""
    kind: str
    """Kind of the items: `sweep`, `fuzz`, `verify`, or a bench such as `bench motion`."""
    title: str
    plan: str
    """Hash over the names of all items."""
    names: tuple[str, ...]
    """Names of all items, in the order of the merged table."""
    about: Any = None
    """Facts that only this kind needs when the shares are merged."""


class StoredResult(Struct, frozen=True):
    """Content of one result file."""

    name: str
    plan: str
    lfa: str
    complaint: str
    data: Any


class CampaignFolder:
    """Results of one campaign on one machine; several processes may write to it at the same time."""

    def __init__(self, path: Path, campaign: Campaign) -> None:
        self.path = path
        self.campaign = campaign

    def done(self) -> set[str]:
        """Return the names of the items whose results are here; each file is read. Raises Refused for a damaged one."""
        return {result.name for result in self.results()}

    def names_there(self) -> set[str]:
        """Return the names of the result files; none is read."""
        return {path.stem for path in (self.path / RESULTS).glob("*.json")}

    def results(self) -> list[StoredResult]:
        """Return all results that are here, in the order of the campaign. Raises Refused for one that is damaged."""
        there = self.names_there()
        strange = there - set(self.campaign.names)
        if strange:
            raise Refused(f"{self._file(min(strange))}: no result of this campaign: must lie in another folder")
        return [self.read(name) for name in self.campaign.names if name in there]

    def store(self, name: str, result: ItemResult) -> None:
        """Write the result of an item, in one step for every reader. Raises Refused when the disk does not take it."""
        stored = StoredResult(name, self.campaign.plan, self.campaign.lfa, result.complaint, result.data)
        _write(self._file(name), msgspec.json.encode(stored, order="deterministic") + b"\n")

    def read(self, name: str) -> StoredResult:
        """Return one result. Raises Refused for one that is damaged or of another campaign."""
        path = self._file(name)
        try:
            found = read_json(path, StoredResult)
        except DamagedFile as error:
            raise Refused(f"{path}: half-written or damaged ({error}): remove it, and it is done again") from None
        except OSError as error:
            raise Refused(
                f"{path}: {error.strerror}: must be a file that can be read; removed, it is done again"
            ) from None
        if found.name != name:
            raise Refused(f"{path}: the result of {found.name}: remove it, and {name} is done again")
        if (found.plan, found.lfa) != (self.campaign.plan, self.campaign.lfa):
            raise Refused(f"{path}: a result of another plan or of another version ({found.lfa}): must be removed")
        return found

    def _file(self, name: str) -> Path:
        return self.path / RESULTS / f"{name}.json"


def open_folder(path: Path, campaign: Campaign) -> CampaignFolder:
    """Return the folder of `campaign` at `path`, made if there is none.

    Raises Refused for a folder of something else, of another plan or of another version, and leaves it as it is.
    """
    described = path / DESCRIPTION
    try:
        if not described.exists():
            if path.exists() and any(not _ours(entry.name) for entry in path.iterdir()):
                raise Refused(f"--out {path}: not empty and no campaign: must be a new folder or that of this campaign")
            (path / RESULTS).mkdir(parents=True, exist_ok=True)
            _write(described, msgspec.json.encode(campaign) + b"\n")
    except OSError as error:
        raise Refused(f"--out {path}: {error.strerror}: must be a folder to write to") from None
    _check_same(described, read_description(path), campaign)  # also when another share wrote it just now
    (path / RESULTS).mkdir(exist_ok=True)
    return CampaignFolder(path, campaign)


def read_description(path: Path) -> Campaign:
    """Return what the campaign in the folder `path` is. Raises Refused for a folder that is none."""
    must = "must be the folder of a campaign that this version began"
    return read_given_json(path / DESCRIPTION, Campaign, must, bytes_max=DESCRIPTION_BYTES_MAX)


def _ours(name: str) -> bool:
    """Return True for an entry that a campaign which begins at this moment, on another machine, may have made."""
    return name == RESULTS or name.startswith(f"{DESCRIPTION}.")


def _write(path: Path, data: bytes) -> None:
    """Write a file in one step for every reader; shares that write the same one do not meet. Raises Refused."""
    reason = replace_file(path, data, f"{socket.gethostname()}-{os.getpid()}")
    if reason:
        raise Refused(f"{path}: {reason}: must be a place that has room, and that this user may use")


def _check_same(path: Path, found: Campaign, wanted: Campaign) -> None:
    if found.lfa != wanted.lfa:
        raise Refused(f"{path}: of {found.lfa}, and this is {wanted.lfa}: give another --out, or run that version")
    if found.kind != wanted.kind or found.plan != wanted.plan:
        raise Refused(f"{path}: of another plan ({found.title}, {len(found.names)} items): give another --out")
