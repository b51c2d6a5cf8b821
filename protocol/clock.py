"""Real clocks, and the only import of `time` in `protocol` and `agents`.

CLOCK_BOOTTIME goes on in system suspend: a woken laptop must not believe in a lease that ran out while it slept.
"""

from __future__ import annotations

import time

_BOOTTIME = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)


def now() -> float:
    """Seconds of this machine's boot clock: monotonic, with an arbitrary zero."""
    return time.clock_gettime(_BOOTTIME)


def wall_ms() -> int:
    """Wall-clock milliseconds: an ordering aid for incarnations and term numbers only, never for a lease."""
    return time.time_ns() // 1_000_000


def cpu_s() -> float:
    """Processor time used by this process so far [s]."""
    return time.process_time()


def thread_s() -> float:
    """Processor time used by this thread so far [s]: what a computation costs, however busy the machine is."""
    return time.thread_time()


def sleep(duration_s: float) -> None:
    time.sleep(duration_s)
