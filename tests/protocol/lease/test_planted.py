"""Each planted bug is noticed by its directed test, which notices nothing without it; and each rule has such a test."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.protocol.lease.hunt import ALL, DRAWN, begin_of, on_page
from tests.protocol.lease.planted import PLANTED, Bug

PAGE = Path(__file__).parents[3] / "protocol" / "README.md"
TESTS = "".join(path.read_text() for path in sorted(Path(__file__).parent.glob("test_*.py")))
USUAL_BUGS, WORDINGS = 15, 10
ROWS = ("| bug", "| mutant", "| wording", "| rule")


@pytest.mark.parametrize("bug", PLANTED, ids=lambda bug: f"{bug.where}: {bug.what}")
def test_a_planted_bug_is_seen(bug: Bug, monkeypatch: pytest.MonkeyPatch) -> None:
    bug.directed()
    with monkeypatch.context() as patch:
        bug.plant(patch)
        with pytest.raises(AssertionError):
            bug.directed()


def test_every_usual_bug_and_every_failed_wording_is_planted() -> None:
    where = [bug.where for bug in PLANTED]
    assert {w for w in where if w.startswith("bug ")} == {f"bug {n}" for n in range(1, USUAL_BUGS + 1)}
    assert where.count("wording") == WORDINGS


def test_the_page_has_a_row_for_every_planted_bug_in_their_order() -> None:
    """Else: make planted PLANTED=--write."""
    rows = [row for row in on_page(DRAWN) if row.startswith(ROWS)]
    assert rows == [begin_of(bug) for bug in PLANTED]


def test_the_page_has_what_all_searches_together_find_in_the_same_order() -> None:
    """Else: make hunt PLANTED=--write."""
    found = [row for row in on_page(ALL) if row.startswith(ROWS)]
    assert found == [row for row in map(begin_of, PLANTED) if row in found]


def test_every_rule_has_a_directed_test() -> None:
    rules = re.findall(r"^\| E(\d+) \|", PAGE.read_text(), re.MULTILINE)
    assert len(rules) >= 22
    assert [rule for rule in rules if f"def test_e{rule}_" not in TESTS] == []
