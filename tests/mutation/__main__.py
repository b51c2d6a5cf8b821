"""`make mutants FILE=protocol/lease/holder.py`: put small faults into a file, one at a time, and run its room's tests.

Prints each fault that no test noticed, then how many were killed; exit code 1 if fewer than 90 % were. Nothing on disk
changes: each fault has a forked process of its own, in which the import of that one file gives the changed code.
README.md says why no ready-made tool does it, and lists the faults that no test can notice.
"""

from __future__ import annotations

import argparse
import ast
import importlib.machinery
import os
import signal
import sys
import time
from pathlib import Path
from random import Random
from types import CodeType

import hypothesis  # noqa: F401  loaded once, before the forks
import numpy  # noqa: F401
import pytest

from tests.mutation.mutate import Mutant, mutants

ROOT = Path(__file__).parents[2]
QUICK = {"protocol/lease": "protocol/lease/traces"}
"""Tests of a room that run first: they are fast and notice most."""
SHARE_MIN = 0.9
KINDS = "not processes and not hosts and not campaign and not wheel"
OPTIONS = ("-x", "-q", "-p", "no:cacheprovider", "--hypothesis-seed=1", "-m", KINDS)


def tests_of(file: Path) -> list[str]:
    """Return the tests of `file`: its own, then those of its folder below tests/, or of the next one up."""
    room, own = file.parent, Path("tests") / file.parent / f"test_{file.stem}.py"
    while not (ROOT / "tests" / room).is_dir():
        room = room.parent
    first = [str(own)] if (ROOT / own).exists() else [f"tests/{QUICK[str(room)]}"] if str(room) in QUICK else []
    return [*first, f"tests/{room}"]


def passes(file: Path, tree: ast.Module, tests: list[str], seconds: int) -> bool:
    """Run `tests` in a fork in which `file` is `tree`; return True if they pass within `seconds` [s]."""
    child = os.fork()
    if child == 0:
        signal.alarm(seconds)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        os.dup2(1, 2)
        _replace(os.path.realpath(file), tree)
        os._exit(pytest.main([*OPTIONS, *tests]))
    return os.waitpid(child, 0)[1] == 0


def _replace(path: str, tree: ast.Module) -> None:
    """Let the import of the file at `path` give the code of `tree`."""
    as_it_is = importlib.machinery.SourceFileLoader.get_code

    def get_code(self: importlib.machinery.SourceFileLoader, name: str) -> CodeType | None:
        if os.path.realpath(self.path) == path:
            return compile(ast.fix_missing_locations(tree), self.path, "exec", dont_inherit=True)
        return as_it_is(self, name)

    importlib.machinery.SourceFileLoader.get_code = get_code  # type: ignore[method-assign]


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("file", type=Path, help="a source file, such as protocol/lease/holder.py")
    parser.add_argument("--sample", type=int, help="try this many faults, drawn at random (all)")
    parser.add_argument("--lines", type=int, nargs="+", help="try the faults in these lines, once more")
    parser.add_argument("--seed", type=int, default=1, help="of the draw (1)")
    parser.add_argument("--tests", nargs="+", help="tests to run (those of the file's room)")
    given = parser.parse_args()
    file = given.file.resolve().relative_to(ROOT)
    source, tests = (ROOT / file).read_text(), given.tests or tests_of(file)
    found: list[Mutant] = [mutant for mutant in mutants(source) if not given.lines or mutant.line in given.lines]
    if given.sample is not None and given.sample < len(found):
        found = sorted(Random(given.seed).sample(found, given.sample), key=lambda mutant: mutant.line)
    began = time.perf_counter()
    if not passes(ROOT / file, ast.parse(source), tests, 3600):
        print(f"{file}: its tests fail without a fault: .venv/bin/pytest {' '.join(tests)}", file=sys.stderr)
        return 2
    patience_s = 30 + int(5.0 * (time.perf_counter() - began))
    survivors = []
    for mutant in found:
        if passes(ROOT / file, mutant.tree, tests, patience_s):
            survivors.append(mutant)
            print(f"survived  {file}:{mutant}", flush=True)
    killed = len(found) - len(survivors)
    print(f"{file}: {killed} of {len(found)} killed in {time.perf_counter() - began:.0f} s")
    return 0 if killed >= SHARE_MIN * len(found) else 1


if __name__ == "__main__":
    sys.exit(main())
