"""Shares of a campaign on an engine, watched until all of them have ended."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path

from lfa.deploy.campaign.engines.executors import DASK, Handle, on_dask, on_submitit
from lfa.deploy.campaign.folder import CampaignFolder
from lfa.deploy.campaign.progress import CampaignProgress
from lfa.protocol.errors import Refused
from lfa.protocol.output import visible, write_line

ENGINES = ("local", "slurm", f"{DASK}HOST:PORT", "kubernetes")
LOOK_EVERY_S = 1.0
DID_ITS_WORK = (0, 1)
"""Exit codes of a share whose runs were done, whether they are good or not; 2: of another version, or another plan."""
LOST = -1


def engine(on: str, folder: Path, commands: Sequence[list[str]], minutes: int, jobs: int, options: Mapping[str, str]
           ) -> AbstractContextManager[list[Handle]]:  # fmt: skip
    """Return the submission of the shares to the engine named by `--on`. Raises Refused for another name."""
    check_engine(on)
    if on.startswith(DASK):
        return on_dask(on, commands)
    return on_submitit(folder, commands, on, minutes, jobs, options)


def check_engine(on: str) -> None:
    """Raise Refused for a name of `--on` that is no engine."""
    if on not in ENGINES and not on.startswith(DASK):
        raise Refused(f"--on {on}: must be one of {', '.join(ENGINES)}")


def watch(handles: Sequence[Handle], kept: CampaignFolder) -> int:
    """Show the progress until all shares have ended; return the number of shares that did not do their work.

    Results that other machines write are seen in the folder.
    """
    total = len(kept.campaign.names)
    seen = kept.names_there()
    progress, open_ones, wrong = CampaignProgress(total, len(seen)), dict(enumerate(handles, start=1)), 0
    while open_ones:
        ended = [number for number, handle in open_ones.items() if handle.done()]
        if not ended:
            time.sleep(LOOK_EVERY_S)
        for name in sorted(kept.names_there() - seen):
            seen.add(name)
            progress.step(name, kept.read(name).complaint)
        for number in ended:
            wrong += _failed(number, open_ones.pop(number))
    progress.close()
    return wrong


def _failed(number: int, handle: Handle) -> bool:
    """Return True, and say why, for a share that ended without having done its work; failed runs are no reason."""
    try:
        code, said = handle.result()
    except Exception as error:  # noqa: BLE001 - engines have errors of their own: lost workers, time limits
        code, said = LOST, f"{type(error).__name__}: {error}"
    if code in DID_ITS_WORK:
        return False
    last = said.strip().splitlines()[-1] if said.strip() else "no message"
    write_line(visible(f"share {number}: exit code {code}: {last}"), sys.stderr)
    return True
