"""Ledger of a machine's processes: what a later supervisor, `lfa down` and `lfa doctor` know of them."""

from __future__ import annotations

import signal
from contextlib import suppress
from pathlib import Path

from msgspec import Struct

from lfa.deploy.fleet.plan.host_plan import SOCKET
from lfa.deploy.process import identity
from lfa.deploy.process.identity import Identity
from lfa.protocol.file_reading import DamagedFile, read_json

LEDGER = "processes.json"
"""File beside the plan with the supervisor and its children; read by a later incarnation, `lfa down`, `lfa doctor`."""


class Ledger(Struct, frozen=True):
    """Identities of a fleet's supervisor and child processes on this machine."""

    run: str
    digest: str
    supervisor: Identity
    children: tuple[Identity, ...] = ()


def ledger(folder: Path) -> Ledger | None:
    """Return what the supervisor of that folder wrote last, None without a readable file."""
    try:
        return read_json(folder / LEDGER, Ledger)
    except (OSError, DamagedFile):
        return None


def living(folder: Path) -> Ledger | None:
    """Return the ledger of that folder if its supervisor is running, else None."""
    written = ledger(folder)
    alive = written is not None and identity.identify(written.supervisor.pid) == written.supervisor
    return written if alive else None


def end_orphans(folder: Path) -> list[str]:
    """Kill exactly the processes that the last supervisor of that folder left; return their command lines."""
    written = ledger(folder)
    if written is None or living(folder) is not None:
        return []
    return [" ".join(child.arguments) for child in written.children if identity.send_signal(child, signal.SIGKILL)]


def sweep(folder: Path) -> None:
    """Remove the files that a supervisor could not remove itself: socket, its lock, ledger."""
    for name in (SOCKET, f"{SOCKET}.lock", LEDGER):
        with suppress(OSError):  # of a file system that became read-only: a later start replaces them
            (folder / name).unlink(missing_ok=True)
