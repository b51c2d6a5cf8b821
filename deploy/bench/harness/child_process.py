"""Child process that is measured beside a running team: start, wait, processor time, end."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence

from lfa.deploy.bench.harness.team import Team
from lfa.deploy.process import identity
from lfa.protocol import clock

LFA = (sys.executable, "-c", "from lfa.deploy.cli import main; main()")
"""Words that run `lfa` of this installation."""


@contextlib.contextmanager
def started(
    words: Sequence[str], stdin: int = subprocess.DEVNULL, stdout: int = subprocess.DEVNULL
) -> Iterator[subprocess.Popen[bytes]]:
    """Start the command `words`; terminate it with SIGTERM when the block ends."""
    process = subprocess.Popen(words, stdin=stdin, stdout=stdout, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait()


def pause(team: Team, duration_s: float) -> None:
    """Wait for `duration_s`, and receive the team's messages meanwhile so that they do not accumulate."""
    until = clock.now() + duration_s
    while clock.now() < until:
        team.listen()
        clock.sleep(0.1)


def cpu_s(process: subprocess.Popen[bytes]) -> float:
    """Return the processor time [s] that a running process has used."""
    own = identity.identify(process.pid)
    assert own is not None, "it has ended"
    return identity.cpu_s(own)
