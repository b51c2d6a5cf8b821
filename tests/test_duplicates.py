"""No two places of the product hold the same six or more lines of logic, whatever the names in them.

Logic is a run of statements in a function, with at least one that is more than a plain assignment: constructors that
only store their arguments, constants and declarations may look alike.
"""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from tests.test_imports import PACKAGES, ROOT

LINES_MIN = 6
PLAIN = (ast.Assign, ast.AnnAssign, ast.Import, ast.ImportFrom, ast.Expr, ast.Pass)


_NAME = re.compile(r"(Name|arg)\('(\w+)'")
_ATTRIBUTE = re.compile(r", '(\w+)', (?:Load|Store)\(")
_CONSTANT = re.compile(r"Constant\([^()]*\)")


def _shape(statements: list[ast.stmt]) -> str:
    """The statements without their words: names by their order of appearance, no numbers and texts."""
    numbers: dict[str, int] = {}
    text = "\n".join(ast.dump(statement, annotate_fields=False) for statement in statements)
    text = _CONSTANT.sub("", text)
    text = _NAME.sub(lambda found: f"{numbers.setdefault(found[2], len(numbers))}", text)
    return _ATTRIBUTE.sub(lambda found: f"{numbers.setdefault(found[1], len(numbers))}", text)


def _bodies(tree: ast.AST) -> Iterator[list[ast.stmt]]:
    """Every block of statements inside a function."""
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef):
            for node in ast.walk(function):
                for field in ("body", "orelse", "finalbody"):
                    block = getattr(node, field, None)
                    if isinstance(block, list) and block:
                        yield block


def _runs(block: list[ast.stmt]) -> Iterator[list[ast.stmt]]:
    """The shortest runs of at least LINES_MIN lines, one from each statement on."""
    for begin in range(len(block)):
        for end in range(begin + 1, len(block) + 1):
            run = block[begin:end]
            if (run[-1].end_lineno or 0) - run[0].lineno + 1 >= LINES_MIN:
                if not all(isinstance(statement, PLAIN) for statement in run):
                    yield run
                break


def repeated(files: list[Path], root: Path) -> list[str]:
    """Places that share a run of logic, a line for each."""
    places: dict[str, set[str]] = defaultdict(set)
    for path in files:
        for block in _bodies(ast.parse(path.read_text())):
            for run in _runs(block):
                places[_shape(run)].add(f"{path.relative_to(root)}:{run[0].lineno}")
    return sorted(" ~ ".join(sorted(where)) for where in places.values() if len(where) > 1)


def test_no_two_places_share_six_lines_of_logic() -> None:
    files = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
    found = repeated(files, ROOT)
    assert not found, "\n".join(found)


def test_a_planted_repetition_is_seen_whatever_its_names(tmp_path: Path) -> None:
    loop = "for {1} in range(9):\n        if {1} % 2:\n            {0} += {1}\n        else:\n            {0} -= 1\n"
    body = f"    {{0}} = 0\n    {loop}"
    (tmp_path / "a.py").write_text(f"def one():\n{body.format('total', 'n')}    return total\n")
    (tmp_path / "b.py").write_text(f"def two():\n    print()\n{body.format('summed', 'item')}")
    assert repeated([tmp_path / "a.py", tmp_path / "b.py"], tmp_path) == ["a.py:2 ~ b.py:3"]
