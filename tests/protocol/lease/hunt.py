"""After how many schedules of `lfa fuzz` each planted bug is noticed: `python -m tests.protocol.lease.hunt`.

Prints a row a bug, as Markdown, as they come; `--write` keeps each in the table of protocol/README.md, so that a long
search can be done in shares (`--only 'rule E2'`). Random schedules alone miss what a directed test sees at once: that
is what the table is for. `--together` (`make hunt`) searches with drawn, systematic and guided schedules, and
such of the fleet stop alone, and prints how many of the bugs are found; what is found in a hundred drawn ones is found
there, too.
"""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import NamedTuple

import pytest

from lfa.deploy.fuzz.search.searches import Kind, Search
from tests.protocol.lease.planted import PLANTED, Bug

PAGE = Path(__file__).parents[3] / "protocol" / "README.md"
SEEDS = 100
TOGETHER: tuple[tuple[Kind, int], ...] = (
    ("drawn", 500),
    ("stops", 300),
    ("systematic", 300),
    ("guided", 200),
)
"""Schedules of each search in a hunt by all of them: those of the second follow where the first finds nothing."""
MISSED = "not in "
SCHEDULE_S_MAX = 60
"""Processor time [s] of one schedule: a bug may keep a lease busy for ever at one moment of virtual time."""


class Table(NamedTuple):
    """Table of protocol/README.md between two marks, and the searches whose result is its last column."""

    mark: str
    column: str
    searches: tuple[tuple[Kind, int], ...]

    @property
    def begin(self) -> str:
        return f"<!-- begin: {self.mark} -->\n"

    @property
    def end(self) -> str:
        return f"<!-- end: {self.mark} -->\n"

    @property
    def schedules(self) -> int:
        return sum(schedules for _, schedules in self.searches)


DRAWN = Table("make planted", "fuzz finds", (("drawn", SEEDS),))
ALL = Table("make hunt", "all searches find", TOGETHER)


def found(bug: Bug, searches: Sequence[tuple[Kind, int]]) -> str:
    """`I1 after 8`: the first invariant that falls, and the number of schedules played until then.

    Of a search that is not the first: `I1 after 8 systematic`, and as many of each search before it.
    """
    for kind, seeds in searches:
        played = 0
        name = "" if kind == searches[0][0] else f" {kind}"
        try:
            with pytest.MonkeyPatch.context() as patch:
                bug.plant(patch)
                schedules = Search(kind).played(range(seeds))
                for played in range(1, seeds + 1):
                    with _patience(SCHEDULE_S_MAX):
                        violations = next(schedules)[1].violations
                    if violations:
                        return f"{violations[0].name} after {played}{name}"
        except (AssertionError, AttributeError, KeyError, TypeError, TimeoutError) as error:
            return f"{type(error).__name__} after {played}{name}"
    return _missed(searches)


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


def on_page(table: Table) -> dict[str, str]:
    """Return the last cell of each row of a table that stands on the page, by the rest of the row."""
    rows = PAGE.read_text(encoding="utf-8").split(table.begin)[1].split(table.end)[0].splitlines()
    return {f"{row[: row.rindex(' | ')]} |": row[row.rindex(" | ") + 3 : -2] for row in rows if row.endswith(" |")}


def write(table: Table, results: dict[str, str]) -> None:
    """Put the table of all bugs on the page, with what is known of each."""
    lines = [*head(table), *(f"{begin} {results[begin]} |" for begin in map(begin_of, PLANTED) if begin in results)]
    text = "\n".join([*lines, "", total(table, [line.split(" | ")[-1] for line in lines[2:]]), ""])
    page = PAGE.read_text(encoding="utf-8")
    before, after = page.split(table.begin)[0], page.split(table.end, 1)[1]
    PAGE.write_text(before + table.begin + text + table.end + after, encoding="utf-8")


def head(table: Table) -> tuple[str, str]:
    """Return the first two lines of a table."""
    return f"| in the design | planted bug | directed test | {table.column} |", "| --- | --- | --- | --- |"


def total(table: Table, results: Sequence[str]) -> str:
    """Return how many of the bugs were found, and how many have not been searched for."""
    hits = sum(not result.startswith(MISSED) for result in results)
    rest = len(PLANTED) - len(results)
    others = f" The other {rest} have not been searched for since the search changed." if rest else ""
    return f"{hits} of these {len(results)} bugs are found by {table.schedules} schedules.{others}"


def _missed(searches: Sequence[tuple[Kind, int]]) -> str:
    return f"{MISSED}{sum(seeds for _, seeds in searches)}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=SEEDS, help="drawn schedules played before a bug counts as missed")
    parser.add_argument("--together", action="store_true", help="search with drawn, systematic and guided schedules")
    parser.add_argument("--only", default="", help="a share: the bugs in whose first two columns this text stands")
    parser.add_argument("--write", action="store_true", help="put each row into protocol/README.md as it comes")
    arguments = parser.parse_args()
    chosen = [bug for bug in PLANTED if arguments.only in f"{bug.where}: {bug.what}"]
    if not chosen:
        parser.error(f"--only {arguments.only}: must be in a name such as {PLANTED[0].where}: {PLANTED[0].what}")
    table = ALL if arguments.together else DRAWN._replace(searches=(("drawn", arguments.seeds),))
    print("\n".join(head(table)))
    results = []
    for bug in chosen:
        results.append(found(bug, table.searches))
        print(f"{begin_of(bug)} {results[-1]} |", flush=True)
        if arguments.write:
            write(table, {**on_page(table), begin_of(bug): results[-1]})
    print(f"\n{total(table, results)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
