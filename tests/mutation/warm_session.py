"""Runs tests again and again in forks of one pytest session: imported and collected once, traced once, then mutated.

A mutant needs no import of its own: in its fork, the functions of its file get the changed code. Of the tests, it needs
those that run its lines, in this order: what found the last faults, then the quickest. The first that fails ends it.
Times of tests are processor time, for they are compared with those on a machine that is busy, or not.
"""

from __future__ import annotations

import gc
import os
import pickle
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache, partial
from pathlib import Path
from types import CodeType, FrameType, FunctionType
from typing import IO, Any, NamedTuple

import pytest
from hypothesis import HealthCheck, Phase, settings

from tests.mutation.mutate import Mutant, planted

LONGEST_S = 6.0
"""A test that takes longer [s] while it is traced is ended, and not run against mutants: each survivor would wait."""
PATIENCE_S, PATIENCE_FACTOR = 5.0, 10.0
"""With a fault, a test may take so much [s] and so many times what the slowest of its file took without."""
WAIT_S = 600
"""After so long [s] of wall time a fork with a fault has hung."""
NOTICED, UNNOTICED = 1, 0

settings.register_profile(
    "mutants",
    deadline=None,
    database=None,
    phases=(Phase.explicit, Phase.generate),
    suppress_health_check=(HealthCheck.too_slow,),
)  # a failing example is enough: it is not made smaller, and not kept


Line = tuple[str, int]
"""A file's real path, and a line of it."""


class Fault(NamedTuple):
    """A mutant and the real path of its file."""

    path: str
    mutant: Mutant

    @property
    def lines(self) -> set[Line]:
        """Its lines, as `Seen` has them."""
        return {(self.path, line) for line in self.mutant.lines}


class Seen(NamedTuple):
    """What the tests do without a fault."""

    lines: dict[str, set[Line]]
    """Lines of the files that each test runs, by its node id."""
    seconds: dict[str, float]
    failed: list[str]


class WarmSession:
    """A plug-in of pytest that replaces its loop.

    `judge` hears each mutant's number, whether a test noticed it, and whether it runs at import.
    """

    def __init__(
        self, faults: list[Fault], judge: Callable[[int, bool, bool], object], longest_s: float = LONGEST_S
    ) -> None:
        self.faults, self.judge, self.longest_s = faults, judge, longest_s
        self.paths = {fault.path for fault in faults}
        self.at_import: set[Line] = set()
        self.failed: list[str] = []
        """Node ids of tests that fail without a fault."""
        self.killers: list[str] = []
        """Node ids of tests that found a fault, the last one first."""
        self.trusted: set[str] = set()
        """Those of them that also pass alone, without a fault."""

    def pytest_collection(self) -> None:
        """Begin to trace: code that runs while modules are imported is not changed by changing functions later."""
        settings.load_profile("mutants")
        sys.settrace(_tracer(self.paths, self.at_import))

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Run everything once without a fault, then each mutant."""
        sys.settrace(None)
        if session.testsfailed:
            return True
        seen: Seen = self._in_fork(lambda told: _write(told, _run_traced(session, self.paths, self.longest_s)))[1]
        if seen.failed:
            self.failed = seen.failed
            session.testsfailed = len(seen.failed)
            return True
        quick = [item for item in session.items if seen.seconds[item.nodeid] < self.longest_s]
        for number, fault in enumerate(self.faults):
            items = self._in_order([item for item in quick if seen.lines[item.nodeid] & fault.lines], seen)
            self.judge(number, self._noticed(session, items, seen, fault), bool(fault.lines & self.at_import))
        return True

    def _in_order(self, items: list[pytest.Item], seen: Seen) -> list[pytest.Item]:
        rank = {nodeid: place for place, nodeid in enumerate(self.killers)}
        return sorted(items, key=lambda item: (rank.get(item.nodeid, len(rank)), seen.seconds[item.nodeid]))

    def _noticed(self, session: pytest.Session, items: list[pytest.Item], seen: Seen, fault: Fault) -> bool:
        """Return whether one of `items` fails with the fault in, and passes without it."""
        functions = _functions_of(fault.path)
        while items:
            status, killer = self._in_fork(partial(_run_until_failure, session, items, seen, functions, fault))
            if status == UNNOTICED:
                return False
            if killer is None or killer in self.trusted:
                break
            (item,) = (item for item in items if item.nodeid == killer)
            alone, _ = self._in_fork(partial(_run_until_failure, session, [item], seen, [], fault))
            if alone == UNNOTICED:
                self.trusted.add(killer)
                break
            items = [other for other in items if other is not item]  # it fails by itself, out of its order
        if items and killer is not None:
            self.killers = [killer, *(nodeid for nodeid in self.killers if nodeid != killer)]
        return bool(items)

    @staticmethod
    def _in_fork(work: Callable[[IO[bytes]], int]) -> tuple[int, Any]:
        """Return what `work` returns in a fork, and the last whole object that it wrote into its file."""
        with tempfile.TemporaryFile() as told:
            child = os.fork()
            if child == 0:
                os.setpgid(0, 0)
                os._exit(work(told))
            try:
                _, status = os.waitpid(child, 0)
            finally:
                with suppress(ProcessLookupError):
                    os.killpg(child, signal.SIGKILL)  # and workers that it has started
            told.seek(0)
            objects = list(_objects(told))
        return (NOTICED if status else UNNOTICED), objects[-1] if objects else None


def _objects(file: IO[bytes]) -> Iterator[Any]:
    while True:
        try:
            yield pickle.load(file)
        except (EOFError, pickle.UnpicklingError):
            return


def _write(file: IO[bytes], value: object) -> int:
    pickle.dump(value, file)
    file.flush()
    return 0


def _tracer(paths: set[str], lines: set[Line]) -> Callable[[FrameType, str, Any], Any]:
    """Return a trace function that adds to `lines` those that run in the files at `paths`."""
    local: dict[str, Callable[[FrameType, str, Any], Any] | None] = {}

    def for_file(path: str) -> Callable[[FrameType, str, Any], Any]:
        def ran(frame: FrameType, event: str, arg: object) -> Any:
            lines.add((path, frame.f_lineno))
            return ran

        return ran

    def called(frame: FrameType, event: str, arg: object) -> Any:
        name = frame.f_code.co_filename
        if name not in local:
            path = os.path.realpath(name)
            local[name] = for_file(path) if path in paths else None
        return local[name] if frame.f_code.co_name != "<module>" else None

    return called


def _run_traced(session: pytest.Session, paths: set[str], longest_s: float) -> Seen:
    seen = Seen({}, {}, [])
    signal.signal(signal.SIGPROF, lambda *_: pytest.skip("takes too long"))
    for item, following in zip(session.items, [*session.items[1:], None], strict=True):
        lines: set[Line] = set()
        failed, began = session.testsfailed, time.process_time()
        threading.settrace(_tracer(paths, lines))
        sys.settrace(_tracer(paths, lines))
        signal.setitimer(signal.ITIMER_PROF, longest_s)
        item.ihook.pytest_runtest_protocol(item=item, nextitem=following)
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        sys.settrace(None)
        seen.lines[item.nodeid], seen.seconds[item.nodeid] = lines, time.process_time() - began
        if session.testsfailed > failed:
            seen.failed.append(item.nodeid)
    return seen


def _run_until_failure(
    session: pytest.Session,
    items: list[pytest.Item],
    seen: Seen,
    functions: list[FunctionType],
    fault: Fault,
    told: IO[bytes],
) -> int:
    """Plant the fault in `functions` and run `items`; say in `told` which one runs, should it end the fork."""
    _swap(functions, fault)
    signal.alarm(WAIT_S)
    for item, following in zip(items, [*items[1:], None], strict=True):
        _write(told, item.nodeid)
        file = f"{item.nodeid.partition('::')[0]}::"
        slowest_s = max(seconds for nodeid, seconds in seen.seconds.items() if nodeid.startswith(file))
        signal.setitimer(signal.ITIMER_PROF, PATIENCE_S + PATIENCE_FACTOR * slowest_s)
        item.ihook.pytest_runtest_protocol(item=item, nextitem=following)
        if session.testsfailed:
            return NOTICED
    return UNNOTICED


def _codes(code: CodeType) -> Iterator[tuple[tuple[str, int], CodeType]]:
    """Yield each function's code below `code`, by qualified name and first line."""
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield (constant.co_qualname, constant.co_firstlineno), constant
            yield from _codes(constant)


@cache
def _functions_of(path: str) -> list[FunctionType]:
    """Return all functions that stand in the file at `path`, methods and those inside decorators too."""
    functions = [thing for thing in gc.get_objects() if isinstance(thing, FunctionType)]
    return [function for function in functions if os.path.realpath(function.__code__.co_filename) == path]


def _swap(functions: list[FunctionType], fault: Fault) -> None:
    """Give `functions` the code that they have in the file with the fault in it."""
    tree = planted(Path(fault.path).read_text(), fault.mutant)
    codes = dict(_codes(compile(tree, fault.path, "exec", dont_inherit=True)))
    for function in functions:
        code = codes[function.__code__.co_qualname, function.__code__.co_firstlineno]
        function.__code__ = code.replace(co_freevars=function.__code__.co_freevars)  # also where the fault needs fewer
