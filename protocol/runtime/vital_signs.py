"""A process's own measurements (lag, processor share, memory), and the few calls that keep its memory small."""

from __future__ import annotations

import ctypes
import gc
import resource
from pathlib import Path

from lfa.protocol import clock
from lfa.protocol.node import Vitals

VITALS_S = 1.0
M_ARENA_MAX = -8  # malloc.h


class VitalSigns:
    """Measurement of the process's own lag, processor share and memory, once a second."""

    def __init__(self, now: float) -> None:
        self._since = now
        self._cpu_s = clock.cpu_s()
        self._lag_s = 0.0
        self._cpu_percent = 0.0

    def lag(self, late_s: float) -> None:
        """Update with the lateness [s] of a tick."""
        self._lag_s = max(self._lag_s, late_s)

    def due(self, now: float) -> bool:
        """Return True once a second, after measuring the processor share since the last time."""
        if now < self._since + VITALS_S:
            return False
        cpu_s = clock.cpu_s()
        self._cpu_percent = 100.0 * (cpu_s - self._cpu_s) / (now - self._since)
        self._since, self._cpu_s = now, cpu_s
        return True

    def of(
        self, dropped: int, undecodable: int, tick_p99_s: float, refused: tuple[tuple[str, int], ...] = ()
    ) -> Vitals:
        """Return the measurements for one node, given its counters, the length [s] of its ticks, and what was refused
        of which members.
        """
        lag_s, self._lag_s = self._lag_s, 0.0
        return Vitals(lag_s, dropped, undecodable, self._cpu_percent, _resident_mib(), tick_p99_s, refused)


def keep_one_heap() -> None:
    """Allow one heap to the process, not one for each of Zenoh's threads."""
    _libc("mallopt", M_ARENA_MAX, 1)


def settle() -> None:
    """Exclude what the start has made from garbage collection, and return the memory that it has freed."""
    gc.collect()
    gc.freeze()
    _libc("malloc_trim", 0)


def _libc(name: str, *numbers: int) -> None:
    """Call a memory-saving function of glibc; do nothing with another C library."""
    function = getattr(ctypes.CDLL(None), name, None)
    if function is not None:
        function(*numbers)


def _resident_mib() -> float:
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except (OSError, IndexError, ValueError):
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return pages * resource.getpagesize() / 2**20
