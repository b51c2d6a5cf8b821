"""Garbage collection while a team is simulated."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

SELDOM = (10_000, 10, 1000)
"""Thresholds of the collector's three generations, of which Python's own are 700, 10 and 10."""


@contextmanager
def seldom_collected() -> Iterator[None]:
    """Collect garbage more seldom within the block, and hardly ever among what is old.

    A team of hundreds is a million objects that live as long as it does. Messages are no cycles, and go without the
    collector; but those that are held until they are recorded had it search all the old ones for each few thousand.
    """
    before = gc.get_threshold()
    gc.set_threshold(*SELDOM)
    try:
        yield
    finally:
        gc.set_threshold(*before)
