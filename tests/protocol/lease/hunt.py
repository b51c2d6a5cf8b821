"""After how many schedules of `lfa fuzz` each planted bug is noticed: `python -m tests.protocol.lease.hunt`.

Prints a row a bug, as Markdown, as they come. Random schedules alone miss what a directed test sees at once: that is
what the table is for.
"""

from __future__ import annotations

import argparse
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

import pytest

from lfa.deploy.fuzz.fault_injector import play
from lfa.deploy.fuzz.schedules import draw
from tests.protocol.lease.planted import PLANTED, Bug

SEEDS = 100
SCHEDULE_S_MAX = 60
"""A bug may keep a lease busy for ever at one moment of virtual time."""


def found(bug: Bug, seeds: int) -> str:
    """`I1 after 8`: the first invariant that falls, and the number of schedules played until then."""
    for seed in range(seeds):
        try:
            with pytest.MonkeyPatch.context() as patch, _patience(SCHEDULE_S_MAX):
                bug.plant(patch)
                violations = play(draw(seed)).violations
        except (AssertionError, AttributeError, KeyError, TypeError, TimeoutError) as error:
            return f"{type(error).__name__} after {seed + 1}"
        if violations:
            return f"{violations[0].name} after {seed + 1}"
    return f"not in {seeds}"


@contextmanager
def _patience(seconds: int) -> Iterator[None]:
    def over(_signum: int, _frame: FrameType | None) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, over)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def row(bug: Bug, seeds: int) -> str:
    module, _, name = bug.caught_by.partition("::")
    return f"| {bug.where} | {bug.what} | `test_{module}.py` `{name}` | {found(bug, seeds)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=SEEDS, help="schedules played before a bug counts as missed")
    arguments = parser.parse_args()
    print("| in the design | planted bug | directed test | fuzz finds |")
    print("| --- | --- | --- | --- |")
    for bug in PLANTED:
        print(row(bug, arguments.seeds), flush=True)


if __name__ == "__main__":
    main()
