"""Pages that code, tests and scenarios cite: each is in the repository, with the sections that are cited."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from tests.test_imports import ROOT

FOLDERS = ("agents", "world", "protocol", "deploy", "tests")
SUFFIXES = (".py", ".toml", ".md", ".sh", ".json5", ".css")
PAGE = re.compile(r"(?<![\w/.*{}-])((?:[\w-]+/)*[\w-]+\.md)\b")
NUMBER = r"\d+(?:\.\d+)*"
SECTIONS = re.compile(
    rf",?\s+(?:sections?\s+)?({NUMBER}(?:(?:\s*-\s*|,\s*(?:and\s+)?|\s+and\s+|\s+to\s+){NUMBER})*)(?![\w.]*\w)"
)
OWN = Path("tests/test_citations.py")


def files(*suffixes: str) -> list[Path]:
    """All files of the repository with one of the suffixes; environment, runs and caches lie outside of `FOLDERS`."""
    inside = (path for folder in FOLDERS for path in (ROOT / folder).rglob("*"))
    return sorted(p for p in (*ROOT.glob("*"), *inside) if p.suffix in suffixes and p.is_file())


PAGES: dict[str, Path] = {}
"""All pages by lower-case name; of pages that share a name (README.md) the first."""
for _page in files(".md"):
    PAGES.setdefault(_page.name.lower(), _page)


@cache
def sections(page: Path) -> set[str]:
    """Numbers of the page's sections: those of its headings, and those that begin a bold paragraph."""
    return set(re.findall(rf"^(?:#+ |\*\*)({NUMBER})\.? ", page.read_text(), re.MULTILINE))


def cited(text: str) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Name of each page that `text` names, with the numbers of the sections named beside it (both ends of a range)."""
    prose = re.sub(r"\s*\n[ \t]*#?[ \t]*", " ", text)  # a citation may go over a line, also of a comment
    for page in PAGE.finditer(prose):
        numbers = SECTIONS.match(prose, page.end())
        yield page[1], tuple(re.findall(NUMBER, numbers[1])) if numbers else ()


def _wrong(path: Path, text: str) -> list[str]:
    found = []
    for name, numbers in cited(text):
        page = PAGES.get(name.rpartition("/")[2].lower())
        if page is None:
            found.append(f"{path}: {name} is not in the repository")
        else:
            found += [f"{path}: {name} has no section {n}" for n in numbers if n not in sections(page)]
    return found


def test_every_cited_page_and_section_exists() -> None:
    texts = [(p.relative_to(ROOT), p.read_text()) for p in files(*SUFFIXES) if p.relative_to(ROOT) != OWN]
    wrong = [line for path, text in texts for line in _wrong(path, text)]
    wrong = [line for line in wrong if not line.startswith("tests/docs/")]  # they plant names of pages
    assert not wrong, "\n".join(wrong)


def test_the_three_pages_are_cited_by_code() -> None:
    names = [(name, numbers) for p in files(".py") for name, numbers in cited(p.read_text())]
    for page in ("control.md", "lease.md", "zenoh.md"):
        assert sum(name == page and bool(numbers) for name, numbers in names) > 3, page


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("the law (control.md section 2, steps 4 to 7)", ("2",)),
        ("(control.md sections 2.2, 2.3 and 4).", ("2.2", "2.3", "4")),
        ("closest approach (control.md section\n7).", ("7",)),
        ("# takes it (control.md\n# section 5.4).", ("5.4",)),
        ("(lease.md 3.3-3.5, 3.10, 4, 5).", ("3.3", "3.5", "3.10", "4", "5")),
        ("figures over frequency with the theory of control.md 5.1.", ("5.1",)),
        ("control.md 2.2: f v <= 0.8 v_max", ("2.2",)),
        ("(control.md, equation table)", ()),
        ("the bars of control.md, sections 5.4 and 6.", ("5.4", "6")),
    ],
)
def test_a_citation_is_read_as_it_is_written(text: str, numbers: tuple[str, ...]) -> None:
    assert [found for _, found in cited(text)] == [numbers]


@pytest.mark.parametrize("planted", ["control.md 2.9", "lease.md section 42", "design.md section 1", "zenoh.md, 0.9"])
def test_a_planted_wrong_citation_is_seen(planted: str) -> None:
    assert _wrong(Path("x.py"), f"Of old ({planted}).")
