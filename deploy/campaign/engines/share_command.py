"""A share of a campaign as a command line: what crosses to another machine is words, and what comes back an exit code.

Results are files in the folder of the campaign. A share checks that folder before it does anything, so an `lfa` of
another version does nothing (`folder.py`).
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from lfa.deploy.campaign.shard import Shard

LFA = "lfa"
SAID_CHARACTERS_MAX = 2000


def share_commands(plan: Path, out: Path, shares: int, jobs: int, more: Sequence[str] = ()) -> list[list[str]]:
    """Return the command line of each share, without the program; `more` are further options of `lfa campaign`."""
    paths = ["campaign", str(plan.absolute()), "--out", str(out.absolute())]
    return [[*paths, "--shard", str(Shard(n, shares)), "--jobs", str(jobs), *more] for n in range(1, shares + 1)]


def run_share(words: list[str]) -> tuple[int, str]:
    """Run `lfa` with these words on the machine that this is called on; return its exit code and its last errors."""
    beside = Path(sys.executable).with_name(LFA)
    program = str(beside) if beside.is_file() else LFA
    done = subprocess.run([program, *words], stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    return done.returncode, done.stderr[-SAID_CHARACTERS_MAX:]
