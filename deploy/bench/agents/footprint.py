"""Memory and threads of one process, from /proc."""

from __future__ import annotations

import re
from pathlib import Path

from msgspec import Struct

KIB_A_MIB = 1024.0


class Footprint(Struct, frozen=True):
    """Memory [MiB] and threads of a process at one moment."""

    resident_mib: float
    unique_mib: float
    """Memory that no other process shares: what the machine has again once this process ends."""
    threads: int


def footprint(pid: int) -> Footprint:
    """Return the footprint of the process `pid`. Raises OSError if there is none or it is another user's."""
    proc = Path(f"/proc/{pid}")
    threads = _numbers(proc / "status", "Threads")[0]
    return footprint_of((proc / "smaps_rollup").read_text(), threads)


def footprint_of(smaps_rollup: str, threads: int) -> Footprint:
    """Return the footprint that a text of /proc/PID/smaps_rollup says."""
    kib = dict(re.findall(r"^(\w+): +(\d+) kB$", smaps_rollup, re.MULTILINE))
    unique_kib = int(kib["Private_Clean"]) + int(kib["Private_Dirty"])
    return Footprint(int(kib["Rss"]) / KIB_A_MIB, unique_kib / KIB_A_MIB, threads)


def _numbers(path: Path, name: str) -> list[int]:
    return [int(number) for number in re.findall(rf"^{name}:\s+(\d+)", path.read_text(), re.MULTILINE)]
