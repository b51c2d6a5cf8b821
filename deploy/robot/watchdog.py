"""Watchdog process of a driver: runs a stop command when the driver falls silent, dies or hangs.

The watchdog does not share the driver's fate: it is a process of its own with only a pipe from the driver. The
driver writes a byte after each control period in which the hardware answered. The end of the pipe, or silence for
`SILENT_S`, means that nobody controls the motors any more. A stop command that fails or hangs is run again, and a
driver whose watchdog has ended ends too.

Start: `python -m lfa.deploy.robot.watchdog SILENT_S COMMAND...`.
"""

from __future__ import annotations

import lfa.protocol.program_start.installed_first  # noqa: F401 (before any other module)

# isort: split
import os
import select
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import IO

from lfa.protocol import clock
from lfa.protocol.errors import Refused

SILENT_S = 0.25
"""Silence [s] of the driver after which the stop command runs: more than twelve control periods of 20 ms."""
STOP_S_MAX = 2.0
"""Time [s] after which a stop command counts as hung, and is killed."""
STOPS_MAX = 20
"""Number of stop commands after the driver's end, if they fail: it may hold the motors' port for a moment longer."""

PROGRAM = (sys.executable, "-P", "-m", "lfa.deploy.robot.watchdog", str(SILENT_S))


class Watchdog:
    """Driver's side: starts the watchdog process, and keeps it quiet with `alive`."""

    def __init__(self, command: Sequence[str], program: Sequence[str] = PROGRAM) -> None:
        """Start the process; `command` stops the motors. Raises OSError when it cannot be started.

        `program` is another watchdog, which takes `command` as its arguments and may report to `output`.
        """
        quiet = None if program is PROGRAM else subprocess.PIPE
        self._process = subprocess.Popen(
            [*program, *command], stdin=subprocess.PIPE, stdout=quiet, start_new_session=True
        )
        assert self._process.stdin is not None
        self._pipe = self._process.stdin.fileno()
        os.set_blocking(self._pipe, False)

    @property
    def output(self) -> IO[bytes]:
        """Standard output of another watchdog program than `PROGRAM`."""
        assert self._process.stdout is not None
        return self._process.stdout

    def alive(self, _now: float) -> None:
        """Report a control period in which the hardware answered; a full pipe does not stop the driver.

        Raises Refused when the watchdog process has ended: nobody would stop the motors of a driver that hangs.
        """
        try:
            with suppress(BlockingIOError):
                os.write(self._pipe, b".")
        except BrokenPipeError:
            raise Refused("the watchdog process has ended: this driver stops too, start it again") from None


def watch(pipe: int, silent_s: float, stop: Callable[[], int]) -> int:
    """Wait for the driver's first report, then call `stop` at each silence, and at the end; return its exit code.

    While the driver is silent, `stop` is called until it returns 0; after its end `STOPS_MAX` times at most.
    """
    stopped = True  # before the first report no motor has been commanded
    while True:
        ready, _, _ = select.select([pipe], [], [], None if stopped else silent_s)
        if ready and os.read(pipe, 4096):
            stopped = False
            continue
        if not stopped or ready:
            code = stop()
            stopped = code == 0
        if ready:
            return _again(silent_s, stop) if code else 0


def _again(silent_s: float, stop: Callable[[], int]) -> int:
    """Call `stop`, which has failed once, until it returns 0 or has been called often enough; return its last code."""
    code = 1
    for _ in range(STOPS_MAX - 1):
        clock.sleep(silent_s)
        code = stop()
        if code == 0:
            break
    return code


def stop_by(command: Sequence[str]) -> int:
    """Run the stop command; return its exit code, or 1 if it cannot be run or hangs."""
    try:
        return subprocess.run(command, check=False, timeout=STOP_S_MAX).returncode
    except (OSError, subprocess.TimeoutExpired):
        return 1


def main() -> int:
    """Run the watchdog on standard input."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # what ends the driver must not end its watchdog first
    return watch(sys.stdin.fileno(), float(sys.argv[1]), lambda: stop_by(sys.argv[2:]))


if __name__ == "__main__":
    sys.exit(main())
