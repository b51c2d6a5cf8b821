"""Provenance of a run: what made it, where, and by which command line."""

from __future__ import annotations

import platform
import shlex
import socket
import sys
from pathlib import Path

from msgspec import Struct

from lfa.deploy.version import ROOT, commit


class Provenance(Struct, frozen=True):
    """What made a run; the seed is in the summary beside it."""

    version: str
    commit: str | None
    """Commit of the checkout, with `-dirty` if files differ from it; None for an installation."""
    host: str
    python: str
    system: str
    command: str
    """Command line, quoted as a shell needs it."""


def provenance() -> Provenance:
    """Return the provenance of what this process makes."""
    from importlib.metadata import version

    words = [Path(sys.argv[0]).name, *sys.argv[1:]] if sys.argv and sys.argv[0] else ["python"]
    system = f"{platform.system()} {platform.release()} {platform.machine()}"
    at = commit(ROOT)
    return Provenance(version("lfa"), at, socket.gethostname(), platform.python_version(), system, shlex.join(words))
