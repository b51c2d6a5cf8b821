"""All pages of the repository: their links lead somewhere, and the files and names that they quote exist."""

from __future__ import annotations

import re
from fnmatch import fnmatch
from pathlib import Path

import pytest

from tests.test_citations import files
from tests.test_imports import ROOT
from tests.test_paper_map import names_of

PAGES = files(".md")
LINK = re.compile(r"\]\(([^)#\s]*)(?:#([^)\s]*))?\)")
FILES = files(".py")
YOURS = ("carrot.py", "my_robot.py")
FILE = re.compile(r"`([\w/.-]+\.py)(?:::?(\w+))?`")


def _prose(page: Path) -> str:
    return re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings, as browsers and GitHub name them."""
    heads = re.findall(r"^#+ (.+)$", _prose(page), re.MULTILINE)
    return {re.sub(r"\s", "-", re.sub(r"[^\w\s-]", "", head.lower()).strip()) for head in heads}


def dead_links(page: Path) -> list[str]:
    found = []
    for path, anchor in LINK.findall(_prose(page)):
        if re.match(r"\w+:", path):
            continue
        target = (page.parent / path).resolve() if path else page
        if not target.exists() or (anchor and anchor not in anchors(target)):
            found.append(f"{page.name}: {path}#{anchor}")
    return found


def not_on_site(page: Path) -> list[str]:
    """Links of a page to files that `make docs` does not copy to where it builds the site."""
    target = (ROOT / "Makefile").read_text().partition("\ndocs:")[2].partition("\n\n")[0]
    copied = re.findall(r"-(?:name|path) '([^']+)'", target)
    paths = [path for path, _ in LINK.findall(_prose(page)) if path and not re.match(r"\w+:", path)]
    return [
        path
        for path in paths
        if not any(fnmatch(str((page.parent / path).resolve()), f"*{pattern}") for pattern in copied)
    ]


def _places(page: Path, quoted: str) -> list[Path]:
    """The quoted file: from the root, or beside the page, or else every file whose path ends so."""
    near = [path for path in (ROOT / quoted, page.parent / quoted) if path.is_file()]
    return near or [path for path in FILES if path.as_posix().endswith(f"/{quoted}")]


def gone(page: Path) -> list[str]:
    """Files and names that the page quotes and nothing has; NAME.py stands for the reader's own."""
    quoted = [(path, name) for path, name in FILE.findall(_prose(page)) if path not in YOURS and "NAME" not in path]
    places = {path: _places(page, path) for path, _ in quoted}
    return [f"{path}:{name}" for path, name in quoted if not any(not name or name in names_of(p) for p in places[path])]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_of_a_page_leads_somewhere(page: Path) -> None:
    assert dead_links(page) == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_of_a_page_leads_to_a_file_of_the_site(page: Path) -> None:
    """Else `make docs`, which is strict, ends: its target copies some kinds of files only."""
    assert not_on_site(page) == []


def test_a_planted_link_to_a_file_that_is_not_copied_is_seen(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("[a](page.md) [b](https://zenoh.io) [c](data.csv)\n")
    assert not_on_site(page) == ["data.csv"]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_file_and_name_that_a_page_quotes_exists(page: Path) -> None:
    assert gone(page) == []


def test_a_planted_dead_link_and_a_dead_anchor_are_seen(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("# One two\n\n[a](page.md#one-two) [b](none.md) [c](#three)\n")
    assert dead_links(page) == ["page.md: none.md#", "page.md: #three"]


def test_a_planted_name_that_no_file_has_is_seen(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("`agents/agent.py:Agent`, `lease.py:Lease`, `agents/agent.py:Angel`, `leash.py`\n")
    assert gone(page) == ["agents/agent.py:Angel", "leash.py:"]


@pytest.mark.parametrize("package", ["agents", "world"])
def test_a_packages_page_names_every_file_and_folder_at_its_top(package: str) -> None:
    text = (ROOT / package / "README.md").read_text()
    parts = [p for p in (ROOT / package).iterdir() if p.suffix == ".py" or (p / "__init__.py").is_file()]
    names = [p.name for p in parts if p.name != "__init__.py"]
    assert [name for name in names if f"`{name}" not in text] == []


def test_the_page_has_a_row_for_each_condition_of_being_stuck_and_no_other() -> None:
    named = set(re.findall(r'"(S\d): ', (ROOT / "agents" / "recovery" / "stuck_detector.py").read_text()))
    rows = re.findall(r"^\| (S\d) \|", (ROOT / "agents" / "CONTROL.md").read_text(), re.MULTILINE)
    assert named
    assert sorted(named) == rows
