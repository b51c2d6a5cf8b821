"""A process that is looked at beside a running team: started, left alone for a while, and ended."""

from __future__ import annotations

import contextlib
import signal
import subprocess
from collections.abc import Iterator, Sequence

from lfa.deploy.bench.harness.team import Team
from lfa.deploy.process import identity as processes
from lfa.protocol import clock


@contextlib.contextmanager
def started(
    words: Sequence[str], stdin: int = subprocess.DEVNULL, stdout: int = subprocess.DEVNULL
) -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen(words, stdin=stdin, stdout=stdout, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait()


def pause(team: Team, duration_s: float) -> None:
    """The team's own news are heard meanwhile, so that they do not pile up."""
    until = clock.now() + duration_s
    while clock.now() < until:
        team.listen()
        clock.sleep(0.1)


def cpu_s(process: subprocess.Popen[bytes]) -> float:
    identity = processes.identify(process.pid)
    assert identity is not None, "it has ended"
    return processes.cpu_s(identity)
