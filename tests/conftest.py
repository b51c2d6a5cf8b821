"""For all tests: an example of a property may take as long as the machine takes, since speed belongs to `lfa bench`;
and Ctrl-C means what it says, also to a run that a shell has started in the background, where it is ignored.

Workers of pytest-xdist with `--dist loadgroup`: all tests with real processes are in two groups, each run by one
worker, one test after the other, so that there are no more than two teams at a time. Tests that share a fixture of
their module stay together, so that it is made once. Each worker has a runtime folder of its own.
With pytest 9.2, xdist 3.8 does not see the groups: two workers still are two teams, and a test may not rely on what
another one left.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import signal
import tempfile
from collections.abc import Iterator
from contextlib import suppress

import pytest
from hypothesis import settings

settings.register_profile("unhurried", deadline=None)
settings.load_profile("unhurried")

signal.signal(signal.SIGINT, signal.default_int_handler)

RUNTIME = tempfile.mkdtemp(prefix="lfa-", dir="/tmp")
os.environ["XDG_RUNTIME_DIR"] = RUNTIME  # now: some modules ask for the default endpoint when they are imported

PROCESSES = ("tests/processes/", "tests/protocol/transport/test_zenoh_threads.py")
"""Tests below these paths start real processes, whether they say so or not."""
FIRST_GROUP = ("test_run.py", "test_looking.py")
"""Files that take about as long as all others with real processes."""
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


@pytest.hookimpl(tryfirst=True)  # before pytest chooses by marker, and before a worker reads the groups
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark the tests that start processes, and tell xdist which tests stay together."""
    for item in items:
        if item.nodeid.startswith(PROCESSES):
            item.add_marker("processes")
        if hasattr(config, "workerinput") and (group := _group(item)):
            item.add_marker(pytest.mark.xdist_group(group))


def _group(item: pytest.Item) -> str:
    """Return the group of a test; empty when any worker may run it at any time."""
    if item.get_closest_marker("processes"):
        return f"processes {1 if item.path.name in FIRST_GROUP else 2}"
    fixtures = item._fixtureinfo.name2fixturedefs.values()  # type: ignore[attr-defined]
    shared = [one for many in fixtures for one in many if one.scope == "module"]
    return str(item.path) if shared else ""
