"""After how many schedules of `lfa fuzz` each planted bug is noticed: `python -m tests.protocol.lease.hunt`.

Prints a row a bug, as Markdown, as they come; `--write` keeps each in the table of protocol/README.md, so that a long
search can be done in shares (`--only 'rule E2'`). Random schedules alone miss what a directed test sees at once: that
is what the table is for.
"""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import pytest

from lfa.deploy.fuzz.fault_injector import play
from lfa.deploy.fuzz.schedules import draw
from tests.protocol.lease.planted import PLANTED, Bug

PAGE = Path(__file__).parents[3] / "protocol" / "README.md"
BEGIN, END = "<!-- begin: make planted -->\n", "<!-- end: make planted -->\n"
HEAD = ("| in the design | planted bug | directed test | fuzz finds |", "| --- | --- | --- | --- |")
SEEDS = 100
SCHEDULE_S_MAX = 60
"""Processor time [s] of one schedule: a bug may keep a lease busy for ever at one moment of virtual time."""


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
    return _missed(seeds)


@contextmanager
def _patience(seconds: int) -> Iterator[None]:
    """Raise TimeoutError after `seconds` of processor time: a busy machine changes no result."""

    def over(_signum: int, _frame: FrameType | None) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGPROF, over)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def begin_of(bug: Bug) -> str:
    """Return the row of a bug without its last cell."""
    module, _, name = bug.caught_by.partition("::")
    return f"| {bug.where} | {bug.what} | `test_{module}.py` `{name}` |"


def on_page() -> dict[str, str]:
    """Return the last cell of each row that stands on the page, by the rest of the row."""
    rows = PAGE.read_text(encoding="utf-8").split(BEGIN)[1].split(END)[0].splitlines()
    return {f"{row[: row.rindex(' | ')]} |": row[row.rindex(" | ") + 3 : -2] for row in rows if row.endswith(" |")}


def write(results: dict[str, str], seeds: int) -> None:
    """Put the table of all bugs on the page, with what is known of each."""
    lines = [*HEAD, *(f"{begin} {results[begin]} |" for begin in map(begin_of, PLANTED) if begin in results)]
    missed = sum(line.endswith(f"| {_missed(seeds)} |") for line in lines)
    text = "\n".join([*lines, "", f"{missed} of these {len(PLANTED)} bugs are missed by {seeds} schedules.", ""])
    page = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(page.split(BEGIN)[0] + BEGIN + text + END + page.split(END, 1)[1], encoding="utf-8")


def _missed(seeds: int) -> str:
    return f"not in {seeds}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=SEEDS, help="schedules played before a bug counts as missed")
    parser.add_argument("--only", default="", help="a share: the bugs in whose first two columns this text stands")
    parser.add_argument("--write", action="store_true", help="put each row into protocol/README.md as it comes")
    arguments = parser.parse_args()
    chosen = [bug for bug in PLANTED if arguments.only in f"{bug.where}: {bug.what}"]
    if not chosen:
        parser.error(f"--only {arguments.only}: must be in a name such as {PLANTED[0].where}: {PLANTED[0].what}")
    print("\n".join(HEAD))
    for bug in chosen:
        result = found(bug, arguments.seeds)
        print(f"{begin_of(bug)} {result} |", flush=True)
        if arguments.write:
            write({**on_page(), begin_of(bug): result}, arguments.seeds)
    return 0


if __name__ == "__main__":
    sys.exit(main())
