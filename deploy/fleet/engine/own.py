"""Our own engine, for machines without systemd: child processes that are restarted when they end or hang.

The processes outlive it: a later incarnation finds them by their command lines and goes on watching them.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from lfa.deploy.fleet.engine.engine import ROUTER_FIRST_S, KnownProcess, LogSource, Waitable
from lfa.deploy.fleet.engine.log_tail import FileTail
from lfa.deploy.fleet.engine.watchdog import HangDetector, SignSocket
from lfa.deploy.fleet.plan.files import SIGNS
from lfa.deploy.process import identity
from lfa.deploy.process.identity import Identity
from lfa.deploy.process.process_group import ROUTER_NAME, ProcessGroup, ProcessSpec
from lfa.deploy.process.restart_policy import ROUTER, Restart, RestartBackoff
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.messages.fleet import ProcessReport
from lfa.protocol.output import write_line

RESUME = "--resume"
END_S = 1.5
"""Time limit [s] for processes to end. Their final messages take at most 0.7 s; the rest allows for a lost router."""
LEAVE_S = 0.5
"""Time limit [s] for a router to end, which closes links to routers that may have ended already."""
LISTEN_AGAIN_S = 1.0
"""Delay [s] until a router is started again that could listen before, and was refused now."""


class _ManagedProcess:
    """One supervised process: its specification, restart backoff and state."""

    def __init__(self, row: ProcessSpec, backoff: RestartBackoff) -> None:
        self.row = row
        self.backoff = backoff
        self.starts = 0
        self.began = 0.0
        self.began_ms = 0
        self.state = "waiting"
        self.start_at: float | None = 0.0
        self.ended = ""
        self.hung = False
        """True: it was killed because it hung."""
        self.ordered_end = False

    def report(self, pid: int, now: float) -> ProcessReport:
        up_s = round(now - self.began, 1) if pid else 0.0
        return ProcessReport(self.row.name, self.state, pid, self.starts, self.began_ms, up_s, self.ended)


class OwnEngine:
    """Engine with the processes as its children. Every call comes from the main thread."""

    def __init__(
        self, rows: Sequence[ProcessSpec], restart: Restart, folder: Path, run_folder: Path, remembered: Path | None
    ) -> None:
        """`remembered`: file without which a process that can resume starts anew. Raises Refused."""
        self.bound = False
        self._signs = SignSocket(folder / SIGNS)
        self._watchdog = HangDetector(restart.watchdog_s)
        self._processes = ProcessGroup(run_folder, outlive=True, environment={"NOTIFY_SOCKET": str(folder / SIGNS)})
        self._managed = {
            row.name: _ManagedProcess(row, RestartBackoff(ROUTER if row.name == ROUTER_NAME else restart))
            for row in rows
        }
        self._remembered = remembered
        self._router_by = 0.0
        """Time [s] until which the other processes wait for the router."""

    @property
    def names(self) -> Sequence[str]:
        return list(self._managed)

    @property
    def wakes(self) -> Sequence[Waitable]:
        return (self._signs,)

    def start(self, now: float, known: Sequence[KnownProcess] = ()) -> None:
        """Adopt the processes that run already, by their command lines; the others start with the next steps.

        `known` adds their numbers of starts.
        """
        self._router_by = now + ROUTER_FIRST_S
        running = list(identity.own_processes())
        written = {one.identity: one for one in known}
        for managed in self._managed.values():
            found = next((one for one in running if _runs(one, managed.row)), None)
            if found is None:
                continue
            before = written.get(found)
            self._processes.adopt(managed.row.name, found)
            managed.start_at, managed.state, managed.began = None, "running", now
            managed.starts = 1 if before is None else before.starts
            managed.began_ms = clock.wall_ms() if before is None else before.began_ms
            self._watchdog.started(managed.row.name, now)
            write_line(f"adopted {managed.row.name}, process {found.pid}", sys.stdout)

    def step(self, now: float, *, router_up: bool) -> bool:
        pids = {self._processes.pid(name): name for name in self._managed}
        for pid in self._signs.take():
            if pid in pids:
                self._watchdog.alive(pids[pid], now)
        for name in self._watchdog.hung(now):
            self._end_hung(self._managed[name])
        waits = not router_up and now < self._router_by
        changed = [managed for managed in self._managed.values() if self._look_after(managed, now, waits=waits)]
        return bool(changed)

    def _end_hung(self, managed: _ManagedProcess) -> None:
        managed.hung = self._processes.signal(managed.row.name, signal.SIGKILL)

    def _look_after(self, managed: _ManagedProcess, now: float, *, waits: bool) -> bool:
        """Start the process when it is due, detect its end; return True when its state changed."""
        name = managed.row.name
        if managed.start_at is not None:
            if now < managed.start_at or (name != ROUTER_NAME and waits):
                return False
            self._start(managed, now)
            return True
        code = self._processes.code(name)
        if managed.state != "running" or code is None:
            return False
        self._watchdog.ended(name)
        managed.ended = str(self._processes.exit_of(name))
        if managed.hung:
            managed.hung = False
            managed.ended = f"{name} hung: no sign of life for {self._watchdog.limit_s:g} s; killed"
        write_line(managed.ended, sys.stdout)
        if managed.ordered_end:
            managed.ordered_end = False
            managed.start_at, managed.state = now, "waiting"
            return True
        verdict = managed.backoff.ended(code, now)
        managed.start_at, managed.state = verdict.at, verdict.word
        if name == ROUTER_NAME and verdict.at is None:
            if managed.starts == 1:
                raise Refused(managed.ended)
            managed.start_at, managed.state = now + LISTEN_AGAIN_S, "waiting"
        return True

    def _start(self, managed: _ManagedProcess, now: float) -> None:
        row = managed.row if managed.starts == 0 or not self._remembers(managed) else managed.row.restarted()
        managed.start_at = None
        managed.began, managed.began_ms = now, clock.wall_ms()
        managed.starts += 1
        try:
            self._processes.start(row)
            managed.state = "running"
            self._watchdog.started(row.name, now)
        except OSError as error:
            managed.ended = f"{row.name} cannot be started: {error.strerror}"
            verdict = managed.backoff.ended(1, now)
            managed.start_at, managed.state = verdict.at, verdict.word

    def _remembers(self, managed: _ManagedProcess) -> bool:
        """Return False for a world that ended before it wrote its first state: it starts without `--resume`."""
        return not managed.row.restart_args or self._remembered is None or self._remembered.exists()

    def restart(self, name: str, now: float) -> None:
        managed = self._managed[name]
        managed.backoff.forget()
        if self._processes.runs(name):
            managed.ordered_end = True
            self._processes.signal(name, signal.SIGTERM)
            self._processes.signal(name, signal.SIGCONT)
        else:
            managed.start_at = now

    def stop(self, now: float, *, router: bool) -> None:
        names = [name for name in self._managed if (name == ROUTER_NAME) == router]
        self._processes.terminate(names, LEAVE_S if router else END_S)
        for name in names:
            self._managed[name].state, self._managed[name].ended = "ended", "lfa down"

    def kill(self) -> None:
        """Kill all processes: for a start that is refused."""
        self._processes.kill_all()

    def close(self) -> None:
        self._signs.close()

    def states(self, now: float) -> tuple[ProcessReport, ...]:
        return tuple(managed.report(self._processes.pid(name), now) for name, managed in self._managed.items())

    def logs(self, name: str, lines: int, now: float) -> LogSource:
        return FileTail(self._processes.log(name), lines, now)

    def known(self) -> Iterator[KnownProcess]:
        for name, managed in self._managed.items():
            found = self._processes.identity(name)
            if found is not None:
                yield KnownProcess(name, found, managed.starts, managed.began_ms)


def _runs(process: Identity, row: ProcessSpec) -> bool:
    """Return True if `process` was started from `row`, for the first time or again."""
    words = process.arguments
    return "-m" in words and _essence(words[words.index("-m") + 1 :]) == _essence(row.arguments)


def _essence(arguments: Sequence[str]) -> list[str]:
    """Return the arguments without what a restart changes: a leader's role, and the option to resume."""
    words = ["follower" if word == "leader" else word for word in arguments]
    if RESUME in words:
        at = words.index(RESUME)
        del words[at : at + 2]
    return words
