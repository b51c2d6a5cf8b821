"""Questions of a newcomer, answered by following the pages' own links from README.md, two clicks at most.

Five of them are asked as they stand; where a number or a part is in the question, all others of its kind are asked too.
"""

from __future__ import annotations

import re
from collections import deque
from pathlib import Path

import pytest

from tests.docs.test_links import LINK
from tests.test_imports import ROOT
from tests.test_paper_map import names_of

CLICKS_MAX = 2
EQUATIONS = range(1, 34)
NUMBERED = {"E": 36, "I": 16, "L": 7, "S": 6}
"""How many rules, invariants, bounds and stuck conditions there are, by their letter."""
ADDED = ("message", "decision", "motion", "rule of the lease", "scenario", "bench", "command", "fault", "sensor")
LOST = ("a follower dies", "a gateway restarts", "the witness dies", "the router dies", "the operator's machine dies")
"""What `what happens when` may be asked of, besides the leader."""


def reached() -> dict[Path, int]:
    """Every page that links lead to from README.md, with the least number of clicks."""
    clicks, waiting = {ROOT / "README.md": 0}, deque([ROOT / "README.md"])
    while waiting:
        page = waiting.popleft()
        for path, _ in LINK.findall(page.read_text()):
            target = (page.parent / path).resolve()
            if path.endswith(".md") and target.is_file() and target not in clicks:
                clicks[target] = clicks[page] + 1
                waiting.append(target)
    return clicks


def line_with(*words: str) -> tuple[Path, str]:
    """The nearest page that has all the words on one line or in one paragraph, and that text."""
    for page, clicks in sorted(reached().items(), key=lambda item: item[1]):
        for text in re.split(r"\n\n|\n(?=[|#-])", page.read_text()):
            if clicks <= CLICKS_MAX and all(word in text for word in words):
                return page, " ".join(text.split())
    raise AssertionError(f"no page within {CLICKS_MAX} clicks says {words}")


def named(text: str) -> list[tuple[Path, str]]:
    """Files with the names in them that a text quotes, as `path.py:Name`; they exist."""
    found = [(path, name) for path, name in re.findall(r"`([\w/]+\.py):(\w+)`", text)]
    places = [(path if (path := ROOT / p).is_file() else ROOT / "agents" / p, name) for p, name in found]
    assert all(path.is_file() and name in names_of(path) for path, name in places), text
    return places


def test_every_page_is_within_reach() -> None:
    from tests.test_citations import files

    far = [str(p.relative_to(ROOT)) for p in files(".md") if reached().get(p, 99) > CLICKS_MAX + 1]
    assert [path for path in far if "docs/reference" not in path] == []


@pytest.mark.parametrize("question", ["leader dies", "`E15`", "equation (29)", "left or right", "add a sensor"])
def test_the_first_page_has_a_row_for_the_question(question: str) -> None:
    (row,) = [
        line for line in (ROOT / "README.md").read_text().splitlines() if line.startswith("|") and question in line
    ]
    assert LINK.search(row)


def test_where_is_equation_29() -> None:
    page, text = line_with("| (28), (29) |")
    assert page.name == "PAPER.md"
    (code, *_) = named(text)
    assert code == (ROOT / "agents" / "formation" / "kinematics.py", "error_rates")
    assert "eq. 28 to 31" in code[0].read_text()


@pytest.mark.parametrize("number", EQUATIONS)
def test_where_is_an_equation(number: int) -> None:
    page, text = line_with("| (", f"({number})", ".py:")
    assert page.name == "PAPER.md"
    assert named(text)


def test_which_file_decides_left_or_right() -> None:
    page, text = line_with("Left or right?")
    assert page == ROOT / "agents" / "README.md"
    detour, *others = named(text)
    assert detour == (ROOT / "agents" / "avoidance" / "detour.py", "Detour")
    assert {path.name for path, _ in others} == {"openings.py", "decision.py"}
    assert "Action.LEFT if side > 0.0 else Action.RIGHT" in detour[0].read_text()


def test_what_happens_when_the_leader_dies() -> None:
    page, text = line_with("What happens when the leader dies?")
    assert page == ROOT / "protocol" / "LEASE.md"
    assert all(word in text for word in ("the next in the chain stands", "`T_grant`", "`lfa bench failover`"))


@pytest.mark.parametrize("lost", LOST)
def test_what_happens_when_something_else_is_lost(lost: str) -> None:
    page, _ = line_with(f"| {lost}")
    assert page == ROOT / "protocol" / "LEASE.md"


@pytest.mark.parametrize("thing", ADDED)
def test_how_do_i_add_something_else(thing: str) -> None:
    page, _ = line_with(f"## Add a {thing}")
    assert page == ROOT / "CONTRIBUTING.md"


def test_how_do_i_add_a_sensor() -> None:
    page, _ = line_with("# A sensor of your own")
    assert page == ROOT / "world" / "SCENARIO.md"
    steps = page.read_text().partition("# A sensor of your own")[2].partition("# Every key")[0]
    for path, name in re.findall(r"`([\w/]+\.py):(\w+)`", steps):
        assert name in names_of(ROOT / path)
    assert len(re.findall(r"^\| ", steps, re.MULTILINE)) > 6


def test_what_does_e15_mean() -> None:
    page, text = line_with("| E15 |")
    assert page == ROOT / "protocol" / "README.md"
    assert "A vanished token is a liveliness event and proves nothing" in text
    for path in re.findall(r"`(\w+\.py)`", text):
        assert list((ROOT / "protocol" / "lease").rglob(path)), f"{path}, where the rule is said to be"


@pytest.mark.parametrize("rule", [f"{letter}{n}" for letter, last in NUMBERED.items() for n in range(1, last + 1)])
def test_what_does_a_number_mean(rule: str) -> None:
    page, text = line_with(f"| {rule} |")
    assert page == ROOT / ("agents/CONTROL.md" if rule.startswith("S") else "protocol/README.md")
    assert len(text) > len(f"| {rule} | |") + 10


@pytest.mark.parametrize("letter", NUMBERED)
def test_every_number_that_the_code_cites_is_asked_for(letter: str) -> None:
    from tests.test_citations import files

    words = re.compile(rf"(?<![\w.])(?:rule |\(){letter}(\d+)\b")
    cited = {int(number) for path in files(".py") for number in words.findall(path.read_text())}
    assert max(cited) <= NUMBERED[letter]
