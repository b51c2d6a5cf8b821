"""The built documentation site: complete, searchable, and loaded from nowhere else. `make docs` builds and tests it."""

from __future__ import annotations

import json
import os
import re
from functools import cache
from html import unescape
from pathlib import Path

import pytest

from tests.docs.test_newcomer import ADDED, EQUATIONS, LOST
from tests.test_citations import files
from tests.test_imports import PACKAGES, ROOT

SITE = ROOT / os.environ.get("LFA_SITE", "build/no-site")
pytestmark = pytest.mark.skipif(not SITE.is_dir(), reason="make docs builds the site and runs this")

RULES = {
    rule: re.sub(r"[`*]", "", text).strip()
    for page in ("protocol/README.md", "agents/CONTROL.md")
    for rule, text in re.findall(r"^\| ([EILS]\d+) \| ([^|]{,40})", (ROOT / page).read_text(), re.MULTILINE)
}
"""How the text of each numbered rule, invariant, bound and stuck condition begins, as the site shows it."""

WORDS = {
    word: re.sub(r"[`*]", "", text).strip()
    for word, text in re.findall(
        r"^\| ([a-z ]+) \| ([^|]{,30})",
        (ROOT / "protocol/README.md").read_text().partition("| word |")[2],
        re.MULTILINE,
    )
}
"""How the glossary explains each word."""

#   question                                      words for the search       what the best results must say
QUESTIONS = (
    ("where is equation (29)",                    "equation (29)",           "kinematics.py:error_rates"),
    ("which file decides left or right",          "left or right",           "avoidance/decision.py"),
    ("what happens when the leader dies",         "leader dies",             "next in the chain"),
    ("how do I add a sensor",                     "add a sensor",            "protocol/topics.py"),
    ("what does E15 mean",                        "E15",                     "proves nothing"),
    *((f"where is equation ({n})",                f"equation ({n})",         ".py:") for n in EQUATIONS),
    *((f"how do I add a {thing}",                 f"add a {thing}",          f"Add a {thing}") for thing in ADDED),
    *((f"what happens when {lost}",               lost,                      lost) for lost in LOST),
    *((f"what does {rule} say",                   rule,                      text) for rule, text in RULES.items()),
    *((f"what is a {word}",                       word,                      text) for word, text in WORDS.items()),
)  # fmt: skip
RESULTS = 5
TITLE = 10.0
"""How much more a word in a title counts than one in a text; the site's own search counts it a thousand times."""


@cache
def index() -> tuple[tuple[str, str, str, float], ...]:
    """Address, title, text and weight of each section that the search knows."""
    found = json.loads((SITE / "search" / "search_index.json").read_text())["docs"]
    plain = ((d, unescape(d["title"]), unescape(re.sub(r"<[^>]+>", "", d["text"]))) for d in found)
    return tuple((d["location"], title, text, d.get("boost", 1.0)) for d, title, text in plain)


def results(words: str) -> list[tuple[str, str, str, float]]:
    """The sections that a search for `words` lists first: all words, those in a title before those in a text."""
    wanted = re.findall(r"[\w()]+", words.lower())

    def rank(doc: tuple[str, str, str, float]) -> float:
        title, text = doc[1].lower(), doc[2].lower()
        if not all(re.search(rf"(?<!\w){re.escape(word)}(?!\w)", f"{title} {text}") for word in wanted):
            return 0.0
        share = sum(text.count(word) for word in wanted) / (10.0 + len(text.split()))
        named = sum(title.split().count(word) for word in wanted) / (1.0 + len(title.split()))
        return doc[3] * (share + TITLE * named + (words.lower() in text))

    return sorted((doc for doc in index() if rank(doc) > 0.0), key=rank, reverse=True)[:RESULTS]


@pytest.mark.parametrize(("question", "words", "answer"), QUESTIONS, ids=[question for question, *_ in QUESTIONS])
def test_a_newcomers_question_is_answered_by_the_search(question: str, words: str, answer: str) -> None:
    found = results(words)
    assert any(answer in f"{title} {text}" for _, title, text, _ in found), f"{question}: {[doc[:2] for doc in found]}"


def test_every_page_of_the_repository_is_on_the_site() -> None:
    pages = [page.relative_to(ROOT) for page in files(".md")]
    built = [page.with_name("index.html") if page.name == "README.md" else page.with_suffix(".html") for page in pages]
    assert [str(page) for page in built if not (SITE / page).is_file()] == []


@pytest.mark.parametrize("package", PACKAGES)
def test_the_reference_has_every_module_that_has_a_docstring(package: str) -> None:
    page = (SITE / "deploy" / "docs" / "reference" / f"{package}.html").read_text()
    modules = [path.relative_to(ROOT).with_suffix("") for path in (ROOT / package).rglob("*.py")]
    names = ["lfa." + ".".join(module.parts).removesuffix(".__init__") for module in modules if _public(module)]
    assert [name for name in names if f'id="{name}"' not in page] == []


def _public(module: Path) -> bool:
    return not {"examples", "docs"} & set(module.parts) and module.parts != (module.parts[0], "__init__")


def test_the_site_loads_nothing_from_elsewhere() -> None:
    loads = re.compile(r"""<(?:script|link|img|iframe)[^>]+(?:src|href)=["']?(https?:[^"'\s>]+)""")
    found = {address for page in SITE.rglob("*.html") for address in loads.findall(page.read_text())}
    styles = {
        url for path in SITE.rglob("*.css") for url in re.findall(r"url\([\"']?(https?:[^)]*)\)", path.read_text())
    }
    assert found | styles == set()


def test_every_picture_of_the_site_is_small() -> None:
    pictures = [path for path in SITE.rglob("*.png") if "assets" not in path.parts]
    assert pictures
    assert [(path.name, path.stat().st_size) for path in pictures if path.stat().st_size > 150_000] == []
