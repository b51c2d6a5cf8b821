"""For all tests: an example of a property may take as long as the machine takes, since speed belongs to `lfa bench`;
and Ctrl-C means what it says, also to a run that a shell has started in the background, where it is ignored.

Workers of pytest-xdist: tests that share a fixture of their module stay together, so that it is made once; each other
test goes to whoever is free. Two workers are two teams of processes at a time, and a test may not rely on what another
one left. Each worker has a runtime folder of its own.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import signal
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

settings.register_profile("unhurried", deadline=None)
settings.load_profile("unhurried")

signal.signal(signal.SIGINT, signal.default_int_handler)

RUNTIME = tempfile.mkdtemp(prefix="lfa-", dir="/tmp")
os.environ["XDG_RUNTIME_DIR"] = RUNTIME  # now: some modules ask for the default endpoint when they are imported

PROCESSES = ("tests/processes/", "tests/protocol/transport/test_zenoh_threads.py")
"""Tests below these paths start real processes, whether they say so or not."""
RUN = os.environ.get("PYTEST_XDIST_TESTRUNUID", str(os.getpid()))
TEAMS = os.path.join(tempfile.gettempdir(), f"lfa-teams-{os.getuid()}-{RUN}")
"""Lock file of this run of the tests: shared by teams that run, exclusive for a test that needs the machine alone."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that accepts today's traces (`tests/protocol/lease/traces`)."""
    parser.addoption("--rewrite-traces", action="store_true", help="write the golden traces anew instead of comparing")


def pytest_unconfigure(config: pytest.Config) -> None:
    """Remove the runtime folder, and the lock file when all workers are done."""
    shutil.rmtree(RUNTIME, ignore_errors=True)
    if not hasattr(config, "workerinput"):
        with suppress(OSError):
            os.unlink(TEAMS)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Let a test that is marked `alone` wait for the other team, and the other team for it."""
    if not item.get_closest_marker("processes"):
        return (yield)
    handle = os.open(TEAMS, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX if item.get_closest_marker("alone") else fcntl.LOCK_SH)
        return (yield)
    finally:
        os.close(handle)


@pytest.hookimpl(tryfirst=True)  # before pytest chooses by marker
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests that start processes."""
    for item in items:
        if item.nodeid.startswith(PROCESSES):
            item.add_marker("processes")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Return what gives tests to the workers: a file with a fixture of its module is given as a whole.

    xdist's own `loadgroup` cannot do it: it gives tests another id in an attribute that pytest 9.2 does not read.
    """
    from xdist.scheduler import LoadScopeScheduling

    class SharedFixtureScheduling(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = nodeid.partition("::")[0]
            return file if _shares_a_fixture(config.rootpath / file) else nodeid

    return SharedFixtureScheduling(config, log)


@cache
def _shares_a_fixture(file: Path) -> bool:
    return 'scope="module"' in file.read_text()
