"""For all tests: an example of a property may take as long as the machine takes, since speed belongs to `lfa bench`;
Ctrl-C means what it says, also to a run that a shell has started in the background, where it is ignored; and at most
two teams of processes run at a time, each with a runtime folder of its own.
"""

from __future__ import annotations

import fcntl
import os
import signal
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("unhurried", deadline=None)
settings.load_profile("unhurried")

signal.signal(signal.SIGINT, signal.default_int_handler)

TEAMS_MAX = 2
RUN = os.environ.get("PYTEST_XDIST_TESTRUNUID", str(os.getpid()))
SLOTS = Path(tempfile.gettempdir()) / f"lfa-tests-{os.getuid()}-{RUN}"
"""Folder of the lock files of one test run, one for each team that may run."""


class TeamSlot:
    """Right of one worker to run a team of processes, kept from the first to the last such test of a file."""

    def __init__(self) -> None:
        self._held: int | None = None

    def acquire(self) -> None:
        """Wait until fewer than `TEAMS_MAX` workers run teams. The kernel releases what a dead worker held."""
        if self._held is not None:
            return
        SLOTS.mkdir(mode=0o700, exist_ok=True)
        worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:])
        handle = os.open(SLOTS / f"team{worker % TEAMS_MAX}", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        fcntl.flock(handle, fcntl.LOCK_EX)
        self._held = handle

    def release(self) -> None:
        """Let the next worker run a team."""
        if self._held is not None:
            os.close(self._held)
            self._held = None


_slot = TeamSlot()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> Iterator[None]:
    """Hold a team's slot around the tests of a file that start processes, their shared fixtures included."""
    if item.get_closest_marker("processes"):
        _slot.acquire()
    try:
        return (yield)
    finally:
        if nextitem is None or nextitem.path != item.path:
            _slot.release()


@pytest.fixture(scope="session", autouse=True)
def _runtime_folder() -> Iterator[None]:
    """Give each worker its own default endpoint."""
    with tempfile.TemporaryDirectory(prefix="lfa-") as place, pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_RUNTIME_DIR", place)
        yield
