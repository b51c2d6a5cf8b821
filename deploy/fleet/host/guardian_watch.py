"""The supervisor's watch over its guardian (`guardian.py`), which watches over the supervisor."""

from __future__ import annotations

import signal
import subprocess
import sys

from lfa.deploy.fleet.engine.watchdog import HangDetector, SignSocket
from lfa.deploy.fleet.host.guardian import spawn
from lfa.deploy.fleet.host.ledger import GUARD, GUARDIAN, WATCH, watchers
from lfa.deploy.fleet.plan import host_plan
from lfa.deploy.fleet.plan.host_plan import HostPlan
from lfa.deploy.process import identity
from lfa.deploy.process.identity import Identity
from lfa.protocol.output import write_line
from lfa.protocol.runtime.systemd import Notify

SIGN_S = 1.0


class GuardianWatch:
    """Watch over the guardian: signs of life to it, and a new one in place of one that ended or hangs."""

    def __init__(self, part: HostPlan) -> None:
        """Open the socket for its signs of life. Raises Refused."""
        self._part = part
        self._signs = SignSocket(part.folder / GUARD)
        self._watchdog = HangDetector(part.restart.watchdog_s)
        self._sign = Notify(str(part.folder / WATCH))
        self._at = 0.0
        self._known: Identity | None = None
        self._spawned: subprocess.Popen[bytes] | None = None

    def step(self, now: float) -> None:
        """Give a sign of life to the guardian once in SIGN_S, and kill one that gives none."""
        if now >= self._at:
            self._at = now + SIGN_S
            self._sign.alive()
            if self._spawned is not None:
                self._spawned.poll()  # or its end would leave a zombie
            if self._known is None or identity.identify(self._known.pid) != self._known:
                self._find(now)
        if self._known is not None and self._known.pid in self._signs.take():
            self._watchdog.alive(GUARDIAN, now)
        if self._known is not None and self._watchdog.hung(now):
            write_line(f"the guardian hung: no sign of life for {self._watchdog.limit_s:g} s; killed", sys.stdout)
            identity.send_signal(self._known, signal.SIGKILL)

    def _find(self, now: float) -> None:
        """Watch the guardian that runs, or start one."""
        self._known = next(watchers(self._part.folder, GUARDIAN), None)
        if self._known is None:
            write_line("starts a guardian", sys.stdout)
            self._spawned = spawn(GUARDIAN, self._part.folder / host_plan.PART)
            self._known = identity.identify(self._spawned.pid)
        self._watchdog.started(GUARDIAN, now)

    def end(self) -> None:
        """End the guardian: it would start a supervisor again that ended in order."""
        for guardian in watchers(self._part.folder, GUARDIAN):
            identity.send_signal(guardian, signal.SIGTERM)
            identity.send_signal(guardian, signal.SIGCONT)
        self._signs.close()
