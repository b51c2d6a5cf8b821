"""`make mutants FILE=protocol/lease/holder.py`: put small faults into files, one at a time, and run their rooms' tests.

Prints each fault that no test noticed, with the reason where `equivalent.toml` has one, then how many were killed in
each file; exit code 1 if fewer than 90 % of all were, or if the list names a fault that is not there any more or that a
test has noticed. Nothing on disk changes. README.md says why no ready-made tool does it.
"""

from __future__ import annotations

import argparse
import ast
import importlib.machinery
import os
import signal
import sys
import time
import tomllib
from collections.abc import Iterator
from pathlib import Path
from random import Random
from types import CodeType

import hypothesis  # noqa: F401  loaded once, before the forks
import numpy  # noqa: F401
import pytest

from tests.mutation import warm_session
from tests.mutation.mutate import Mutant, mutants, planted
from tests.mutation.warm_session import Fault, WarmSession

ROOT = Path(__file__).parents[2]
LISTED = Path(__file__).parent / "equivalent.toml"
SHARE_MIN = 0.9
KINDS = "not processes and not hosts and not campaign and not wheel"
OPTIONS = ("-q", "-p", "no:cacheprovider", "-p", "no:faulthandler", "--tb=no", "--hypothesis-seed=1", "-m", KINDS)
FURTHER = {
    "agents/following": ("tests/agents/controllers",),
    "agents/perception": ("tests/agents/avoidance/test_ground_crossing.py",),
    "world/physics": ("tests/world",),
    "world/sensors": ("tests/world",),
    "deploy/analysis/verification": ("tests/deploy/fuzz", "tests/protocol/lease/test_planted.py"),
}
"""Tests outside a file's room with claims about it: of controllers as plug-ins, of ground that is crossed, of the whole
world; planted bugs that invariants show."""


def tests_of(file: Path) -> list[str]:
    """Return the tests of `file`: those of its folder below tests/, or of the next one up that has some.

    Of a package's top folder, only the files count: the folders inside are rooms of other files.
    """
    room = file.parent
    while not (ROOT / "tests" / room).is_dir():
        room = room.parent
    if len(room.parts) == 1:
        return sorted(str(path.relative_to(ROOT)) for path in (ROOT / "tests" / room).glob("test_*.py"))
    return [f"tests/{room}", *FURTHER.get(str(file.parent), ())]


def equivalent(file: Path) -> dict[str, str]:
    """Return the faults of `file` that change nothing, by name, each with the reason."""
    with LISTED.open("rb") as listed:
        return dict(tomllib.load(listed).get(str(file), {}))


class Verdicts:
    """What became of each mutant, printed as it comes."""

    def __init__(self, file: Path) -> None:
        self.file, self.reasons = file, equivalent(file)
        self.tried, self.killed, self.explained, self.wrong = 0, 0, 0, 0

    def take(self, mutant: Mutant, *, noticed: bool) -> None:
        """Count `mutant`, and print it if it asks for something to be done or read."""
        reason = self.reasons.get(mutant.name)
        self.tried, self.killed = self.tried + 1, self.killed + noticed
        self.explained += not noticed and reason is not None
        if not noticed:
            print(f"{'survived' if reason is None else 'changes nothing'}  {self.file}:{mutant}", flush=True)
        elif reason is not None:
            self.wrong += 1
            print(f"noticed, though {LISTED.name} says that it changes nothing  {self.file}:{mutant}", flush=True)
        if not noticed and reason is not None:
            print(f"    {reason}", flush=True)

    def enough(self) -> bool:
        """Print how many were killed; return whether that is enough, and the list of those that change nothing true."""
        names = {mutant.name for mutant in mutants((ROOT / self.file).read_text())}
        gone = self.reasons.keys() - names
        for name in gone:
            print(f"no such fault any more, though {LISTED.name} names it  {self.file}: {name}")
        nothing = f", {self.explained} of the others change nothing" if self.explained else ""
        print(f"{self.file}: {self.killed} of {self.tried} killed{nothing}", flush=True)
        return self.killed >= SHARE_MIN * self.tried and not gone and not self.wrong


def passes(path: str, tree: ast.Module, tests: list[str]) -> bool:
    """Run `tests` in a fork that imports the file at `path` as `tree`; return True if they pass."""
    child = os.fork()
    if child == 0:
        signal.alarm(3600)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        os.dup2(1, 2)
        _replace(path, tree)
        os._exit(pytest.main(["-x", *OPTIONS, *tests]))
    return os.waitpid(child, 0)[1] == 0


def _replace(path: str, tree: ast.Module) -> None:
    """Let the import of the file at `path` give the code of `tree`."""
    as_it_is = importlib.machinery.SourceFileLoader.get_code

    def get_code(self: importlib.machinery.SourceFileLoader, name: str) -> CodeType | None:
        if os.path.realpath(self.path) == path:
            return compile(tree, self.path, "exec", dont_inherit=True)
        return as_it_is(self, name)

    importlib.machinery.SourceFileLoader.get_code = get_code  # type: ignore[assignment,method-assign]


def verdicts_of(faults: list[Fault], tests: list[str], longest_s: float) -> Iterator[tuple[int, bool, bool]]:
    """Yield each fault's number, whether a test noticed it, and whether its lines also run at import.

    All happens in a fork, so that this process has not imported the files. Raises ValueError if the tests fail without
    a fault.
    """
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        session = WarmSession(
            faults, lambda *verdict: os.write(writing, "{} {:d} {:d}\n".format(*verdict).encode()), longest_s
        )
        exit_code = pytest.main([*OPTIONS, *tests], plugins=[session])
        if session.failed:
            print(*session.failed, sep="\n", file=sys.stderr, flush=True)
        os._exit(exit_code)
    os.close(writing)
    with os.fdopen(reading) as lines:
        for line in lines:
            number, noticed, at_import = map(int, line.split())
            yield number, bool(noticed), bool(at_import)
    if os.waitpid(child, 0)[1]:
        raise ValueError(f"the tests fail without a fault: .venv/bin/pytest {' '.join(tests)}")


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "files", type=Path, nargs="+", metavar="FILE", help="source files, such as protocol/lease/holder.py"
    )
    parser.add_argument("--sample", type=int, help="try this many faults of each, drawn at random (all)")
    parser.add_argument("--lines", type=int, nargs="+", help="try the faults in these lines, once more")
    parser.add_argument("--seed", type=int, default=1, help="of the draw (1)")
    parser.add_argument("--tests", nargs="+", help="tests to run (those of the file's room)")
    parser.add_argument(
        "--longest",
        type=float,
        default=warm_session.LONGEST_S,
        metavar="SECONDS",
        help=f"leave out tests that take longer while they are traced ({warm_session.LONGEST_S:g} s)",
    )
    return parser.parse_args()


def drawn(file: Path, given: argparse.Namespace) -> list[Fault]:
    """Return the faults of `file` that are asked for."""
    path = ROOT / file
    found = [mutant for mutant in mutants(path.read_text()) if not given.lines or mutant.line in given.lines]
    if given.sample is not None and given.sample < len(found):
        found = sorted(Random(given.seed).sample(found, given.sample), key=lambda mutant: mutant.line)
    return [Fault(os.path.realpath(path), mutant) for mutant in found]


def try_files(files: list[Path], tests: list[str], given: argparse.Namespace) -> bool:
    """Try the faults of `files`, whose tests are the same; return whether these see enough in each."""
    began, verdicts = time.perf_counter(), {os.path.realpath(ROOT / file): Verdicts(file) for file in files}
    faults, again = [fault for file in files for fault in drawn(file, given)], []
    for number, noticed, at_import in verdicts_of(faults, tests, given.longest):
        if at_import and not noticed:
            again.append(faults[number])
        else:
            verdicts[faults[number].path].take(faults[number].mutant, noticed=noticed)
    for path, mutant in again:
        tree = planted(Path(path).read_text(), mutant)
        verdicts[path].take(mutant, noticed=not passes(path, tree, tests))
    enough = [verdict.enough() for verdict in verdicts.values()]
    print(f"{len(faults)} faults in {time.perf_counter() - began:.0f} s", flush=True)
    return all(enough)


def main() -> int:
    given = arguments()
    rooms: dict[tuple[str, ...], list[Path]] = {}
    try:
        for file in (file.resolve().relative_to(ROOT) for file in given.files):
            rooms.setdefault(tuple(given.tests or tests_of(file)), []).append(file)
        seen_enough = [try_files(files, list(tests), given) for tests, files in rooms.items()]
    except (OSError, SyntaxError, ValueError) as error:
        print(f"python -m tests.mutation: {error}", file=sys.stderr)
        return 2
    return 0 if all(seen_enough) else 1


if __name__ == "__main__":
    sys.exit(main())
