"""Standard words: the old private language (left) stays out of names, docstrings and help texts.

The glossary with the ROS and Raft words is in protocol/README.md.
"""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from lfa.deploy.cli import COMMANDS
from tests.test_imports import PACKAGES, ROOT

CLASSES = frozenset(
    """Voice Beliefs Plight Stuck Distress Retreat Footing Around Lead Thing Orders Reign Crew Standing Deed Arena Whole
    Motors LastWord Ear Hand Sight Stopping Peers Ward Lives Part Air Weather Seat Row Trace""".split()  # noqa: SIM905
)
MODULES = frozenset(
    """voice beliefs distress retreat footing around shaping again met marks lines words stage stopping peers crew
    tether chosen onlook standing ending referee motors whole arena weather shapes spikes chronicle sight traced
    overheard readings""".split()  # noqa: SIM905
)
WORDS = (
    "beliefs?", "plight", "distress", "footing", "crew", "deeds?", "reigns?", "lives", "full house", "weather",
    "arena", "onlookers?", "chronicle", "tether", "glimpsed", "at ease", "whoever", "so much",
    "none of these", "voice", "said of", "it is that",
)  # fmt: skip
"""Words of the old language that mean nothing else here; each as a pattern."""
OPENINGS = frozenset({"Of", "What", "Who", "Whose"})
OPENINGS_SHARE_MAX = 0.03


def _trees() -> Iterator[tuple[Path, ast.Module]]:
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            yield path.relative_to(ROOT), ast.parse(path.read_text())


def docstrings(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Line and text of each docstring: of modules, classes, functions, and below constants and fields."""
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        for one in body if isinstance(body, list) else ():
            if isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant) and isinstance(one.value.value, str):
                yield one.lineno, one.value.value


def helps(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Line and text of each `help=` in a call."""
    for node in ast.walk(tree):
        for keyword in node.keywords if isinstance(node, ast.Call) else ():
            if keyword.arg == "help" and isinstance(keyword.value, ast.Constant):
                yield node.lineno, str(keyword.value.value)


def old_words(text: str) -> list[str]:
    """The old words in `text`; names in backticks are code, and quoted keys are contracts."""
    prose = re.sub(r"`[^`]*`", "", text)
    return [word for word in WORDS if re.search(rf"\b{word}\b", prose, re.IGNORECASE)]


def test_no_text_uses_a_word_of_the_old_language() -> None:
    found = [
        f"{path}:{line}: {old_words(text)}"
        for path, tree in _trees()
        for line, text in (*docstrings(tree), *helps(tree))
        if old_words(text)
    ]
    found += [f"lfa {entry.name}: {old_words(entry.help)}" for entry in COMMANDS if old_words(entry.help)]
    assert not found, "\n".join(found)


@pytest.mark.parametrize("planted", ["The crew of one run.", "Of both lives of a robot.", "Ends with the weather."])
def test_a_planted_old_word_is_seen(planted: str) -> None:
    tree = ast.parse(f'def f():\n    """{planted}"""\n\nOption(help={planted!r})\n')
    assert all(old_words(text) for _, text in (*docstrings(tree), *helps(tree)))


def test_no_class_and_no_module_has_a_name_of_the_old_language() -> None:
    classes = [(path, n.name) for path, tree in _trees() for n in ast.walk(tree) if isinstance(n, ast.ClassDef)]
    assert [(str(path), name) for path, name in classes if name.lstrip("_") in CLASSES] == []
    assert [str(path) for path, _ in _trees() if path.stem in MODULES] == []


def test_no_class_name_stands_twice() -> None:
    names = Counter(n.name for _, tree in _trees() for n in ast.walk(tree) if isinstance(n, ast.ClassDef))
    names.pop("Parameters")  # the type of a plug-in's own parameters is called so inside each plug-in
    assert {name: n for name, n in names.items() if n > 1} == {}


def test_docstrings_open_with_a_verb_or_a_quantity() -> None:
    texts = [(f"{path}:{line}", text) for path, tree in _trees() for line, text in docstrings(tree)]
    bad = [where for where, text in texts if text.split()[0].strip(",.:") in OPENINGS]
    assert len(bad) < OPENINGS_SHARE_MAX * len(texts), f"{len(bad)} of {len(texts)}:\n" + "\n".join(bad)


def test_the_glossary_has_its_forty_words() -> None:
    section = (ROOT / "protocol" / "README.md").read_text().partition("## Glossary")[2].partition("\n## ")[0]
    rows = [row for row in section.splitlines() if row.startswith("| ") and not row.startswith("| ---")]
    assert len(rows) > 35
