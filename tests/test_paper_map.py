"""agents/PAPER.md: every section, equation and figure of the paper is on it, and every name on it exists."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from lfa.deploy.cli import COMMANDS
from lfa.deploy.view.figures.catalogue import FIGURES
from lfa.world.description.load import shipped

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "agents" / "PAPER.md").read_text()
QUOTED = sorted(set(re.findall(r"`([^`\n]+)`", PAGE)))
SECTIONS = ("1", "2", "2.1", "3", "3.1", "3.2", "4", "5")


def names_of(path: Path) -> set[str]:
    """What a module defines at its top."""
    found: set[str] = set()
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.AnnAssign | ast.Assign):
            targets = [node.target] if isinstance(node, ast.AnnAssign) else node.targets
            found |= {target.id for target in targets if isinstance(target, ast.Name)}
    return found


@pytest.mark.parametrize("quoted", [text for text in QUOTED if ".py" in text])
def test_a_file_and_a_name_on_the_page_exist(quoted: str) -> None:
    path, _, name = quoted.partition("::") if "::" in quoted else quoted.partition(":")
    assert (ROOT / path).is_file(), quoted
    assert not name or name in names_of(ROOT / path), quoted


@pytest.mark.parametrize("quoted", [text for text in QUOTED if text.startswith("lfa ")])
def test_a_command_on_the_page_exists(quoted: str) -> None:
    _, name, *arguments = quoted.split()
    assert name in {entry.name for entry in COMMANDS}, quoted
    if name in ("sim", "run"):
        assert arguments[0] in shipped(), quoted


@pytest.mark.parametrize("quoted", [text for text in QUOTED if text.startswith("figures/")])
def test_a_figure_on_the_page_is_drawn(quoted: str) -> None:
    assert Path(quoted).stem in {name for name, *_ in FIGURES}


def test_all_of_the_paper_is_on_the_page() -> None:
    equations: set[int] = set()
    for cell in re.findall(r"^\| (\(.*?) \|", PAGE, re.MULTILINE):
        equations |= {int(number) for number in re.findall(r"\((\d+)\)", cell)}
    assert equations == set(range(1, 34))
    _, _, figures = PAGE.partition("## Figures")
    assert {int(number) for number in re.findall(r"^\| (\d+) \|", figures, re.MULTILINE)} == set(range(1, 12))
    assert [section for section in SECTIONS if f"\n| {section} " not in PAGE] == []


def test_figures_3_to_6_are_drawn_with_names_that_exist() -> None:
    shown = dict(re.findall(r"!\[Figure (\d)[^]]*\]\((paper/fig\d\.svg)\)", PAGE))
    assert shown == {number: f"paper/fig{number}.svg" for number in "3456"}
    for path in shown.values():
        drawing = (ROOT / "agents" / path).read_text()
        assert ElementTree.fromstring(drawing).tag.endswith("svg")
        modules = set(re.findall(r"\b(\w+\.py)\b", drawing))
        assert modules <= {found.name for package in ("agents", "protocol") for found in (ROOT / package).rglob("*.py")}
