"""Real clocks; the only module of `protocol` and `agents` that imports `time`.

CLOCK_BOOTTIME also counts during system suspend: a resumed laptop must not use a lease that expired meanwhile.
"""

from __future__ import annotations

import time

_BOOTTIME = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)


def now() -> float:
    """Return this machine's boot-clock time [s]: monotonic, with an arbitrary zero."""
    return time.clock_gettime(_BOOTTIME)


def wall_ms() -> int:
    """Return the wall-clock time [ms], a first guess at the order of incarnations and terms (E23); no lease uses it."""
    return time.time_ns() // 1_000_000


def cpu_s() -> float:
    """Return the processor time [s] used by this process so far."""
    return time.process_time()


def thread_s() -> float:
    """Return the processor time [s] used by this thread so far: a computation's cost, independent of machine load."""
    return time.thread_time()


def sleep(duration_s: float) -> None:
    time.sleep(duration_s)
