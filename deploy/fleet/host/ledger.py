"""Ledger of a machine's processes: what a later supervisor, `lfa down` and `lfa doctor` know of them."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from msgspec import Struct

from lfa.deploy.fleet.engine.engine import KnownProcess
from lfa.deploy.fleet.plan.files import LEDGER, PART, SIGNS, SOCKET
from lfa.deploy.process import identity
from lfa.deploy.process.identity import Identity
from lfa.protocol.file_reading import DamagedFile, read_json

SUPERVISOR, GUARDIAN = "lfa.deploy.fleet.host.supervisor", "lfa.deploy.fleet.host.guardian"
"""Modules of the two processes that start each other again; each is called with the plan's file."""


WATCH, GUARD = "watch.sock", "guard.sock"
"""Sockets in the fleet's folder for the signs of life of the supervisor to its guardian, and of the guardian to it."""


class Ledger(Struct, frozen=True):
    """Identities of a fleet's supervisor and processes on this machine."""

    run: str
    digest: str
    supervisor: Identity
    processes: tuple[KnownProcess, ...] = ()

    @property
    def children(self) -> tuple[Identity, ...]:
        return tuple(known.identity for known in self.processes)


def ledger(folder: Path) -> Ledger | None:
    """Return what the supervisor of that folder wrote last, None without a readable file of this user.

    Another user's could name any process as one to be ended.
    """
    path = folder / LEDGER
    try:
        return read_json(path, Ledger) if path.stat().st_uid == os.geteuid() else None
    except (OSError, DamagedFile):
        return None


def living(folder: Path) -> Ledger | None:
    """Return the ledger of that folder if its supervisor is running, else None."""
    written = ledger(folder)
    alive = written is not None and identity.identify(written.supervisor.pid) == written.supervisor
    return written if alive else None


def watchers(folder: Path, module: str) -> Iterator[Identity]:
    """Yield the running supervisors or guardians of that folder, also those that have not yet written a ledger."""
    path = str(folder / PART)
    for process in identity.own_processes():
        if process.arguments[1:] == ("-P", "-m", module, path):
            yield process


def end_orphans(folder: Path) -> list[str]:
    """Kill exactly the processes that the last supervisor of that folder left; return their command lines.

    Its guardian is killed first: it would start a supervisor again.
    """
    written = ledger(folder)
    if living(folder) is not None:
        return []
    for module in (GUARDIAN, SUPERVISOR):
        for process in watchers(folder, module):
            identity.send_signal(process, signal.SIGKILL)
    left = () if written is None else written.children
    return [" ".join(child.arguments) for child in left if identity.send_signal(child, signal.SIGKILL)]


def sweep(folder: Path) -> None:
    """Remove the files that a supervisor could not remove itself: sockets, the router's lock, ledger."""
    for name in (SOCKET, f"{SOCKET}.lock", SIGNS, WATCH, GUARD, LEDGER):
        with suppress(OSError):  # of a file system that became read-only: a later start replaces them
            (folder / name).unlink(missing_ok=True)
