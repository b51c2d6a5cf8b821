"""`python -m lfa.deploy.fleet.host.guardian PART`: starts the machine's supervisor again when it ends or hangs.

The two watch each other, so that no single death ends the watch over a machine's processes: the supervisor starts a
guardian again in the same way (`supervisor.py`). Neither is the parent that the processes die with.
"""

from __future__ import annotations

import lfa.protocol.program_start.installed_first  # noqa: F401 (before any other module)

# isort: split
import os
import select
import signal
import subprocess
import sys
from pathlib import Path

from lfa.deploy.fleet.engine.watchdog import HangDetector, SignSocket
from lfa.deploy.fleet.host.ledger import GUARD, GUARDIAN, SUPERVISOR, WATCH, watchers
from lfa.deploy.fleet.plan import host_plan
from lfa.deploy.process import identity
from lfa.deploy.process.identity import Identity
from lfa.deploy.process.restart_policy import REFUSED_CODE, ROUTER, RestartBackoff
from lfa.deploy.process.signals import Interrupts
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.output import write_line
from lfa.protocol.runtime.systemd import Notify

STEP_S, SIGN_S = 0.1, 1.0
FOR_GOOD = (0, REFUSED_CODE)
"""Exit codes of a supervisor that is not to run again: ended in order, refused."""


def spawn(module: str, part: Path) -> subprocess.Popen[bytes]:
    """Start a supervisor or guardian in a session of its own, with the output of this process."""
    command = [sys.executable, "-P", "-m", module, str(part)]
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, start_new_session=True)


class _Guard:
    """Watch over one supervisor, be it a child or one that was there before."""

    def __init__(self, part: Path, limit_s: float) -> None:
        self._part = part
        self._signs = SignSocket(part.parent / WATCH)
        self._watchdog = HangDetector(limit_s)
        self._backoff = RestartBackoff(ROUTER)
        self._child: subprocess.Popen[bytes] | None = None
        self._known: Identity | None = None
        self._start_at = 0.0
        self._sign = Notify(str(part.parent / GUARD))
        self._sign_at = 0.0

    def run(self, interrupts: Interrupts) -> int:
        """Guard until the supervisor ends for good, whose exit code is returned, or until a signal."""
        while interrupts.signal is None:
            now = clock.now()
            code = self._step(now)
            if code is not None:
                return code
            if now >= self._sign_at:
                self._sign_at = now + SIGN_S
                self._sign.alive()
            select.select([self._signs], [], [], STEP_S)
        return 0

    def close(self) -> None:
        self._signs.close()

    def _step(self, now: float) -> int | None:
        """Start, watch, or bury the supervisor; return its exit code if it ended for good."""
        if self._known is None:
            if now >= self._start_at:
                self._start(now)
            return None
        alive = self._signs.take()
        if self._known.pid in alive:
            self._watchdog.alive(SUPERVISOR, now)
        if self._watchdog.hung(now):
            write_line(f"the supervisor hung: no sign of life for {self._watchdog.limit_s:g} s; killed", sys.stdout)
            identity.send_signal(self._known, signal.SIGKILL)
        code = None if self._child is None else self._child.poll()
        if code is None and identity.identify(self._known.pid) == self._known:
            return None
        if code in FOR_GOOD:
            return code
        how = "ended" if code is None else f"ended ({code})"
        write_line(f"the supervisor {how}: it is started again", sys.stdout)
        self._known = None
        self._start_at = self._backoff.ended(1, now).at or now
        return None

    def _start(self, now: float) -> None:
        """Watch the supervisor that runs, or start one."""
        self._child = None
        self._known = next(watchers(self._part.parent, SUPERVISOR), None)
        if self._known is None:
            self._child = spawn(SUPERVISOR, self._part)
            self._known = identity.identify(self._child.pid)
        self._watchdog.started(SUPERVISOR, now)


def main() -> None:
    """Run the guardian. Exit codes: the supervisor's, 0 after a signal, 2 refused."""
    part = Path(sys.argv[1])
    try:
        limit_s = host_plan.read(part).restart.watchdog_s
        others = [one for one in watchers(part.parent, GUARDIAN) if one.pid != os.getpid()]
        if others:
            raise Refused(f"{part}: process {others[0].pid} is its guardian already")
        guard = _Guard(part, limit_s)
        with Interrupts() as interrupts:
            code = guard.run(interrupts)
        guard.close()
    except Refused as refused:
        write_line(f"lfa-guardian: {refused}", sys.stderr)
        code = REFUSED_CODE
    sys.exit(code)


if __name__ == "__main__":
    main()
