"""Process group of one run: child processes, started in order, monitored, and terminated in every case."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO

from msgspec import Struct

from lfa.deploy.process.identity import Identity, identify, send_signal, start
from lfa.deploy.recording.run_folder import LOGS
from lfa.protocol import clock

ROUTER_NAME = "router"
GRACE_S = 2.0  # between SIGTERM and SIGKILL
POLL_S = 0.01
UNKNOWN_CODE = 256
"""Exit code of a process whose end its parent alone knows: beyond all that a process can have."""
LAST_BYTES = 4096
"""Number of bytes at the end of a log in which its last line is searched."""


class ProcessSpec(Struct, frozen=True):
    """Specification of one process: its name, and the arguments of `python -m`."""

    name: str
    arguments: tuple[str, ...]
    outlives_launcher: bool = False
    """True: on the launcher's death it receives SIGCONT instead of SIGKILL, resumes if stopped, and ends by itself."""
    restart_args: tuple[str, ...] = ()
    """Additional arguments of a restart."""
    command_prefix: tuple[str, ...] = ()
    """Command that executes the process, such as one that enters a network namespace."""

    def restarted(self) -> ProcessSpec:
        """Return the specification of a restart: an agent starts as a follower, a world resumes by `restart_args`."""
        arguments = tuple("follower" if word == "leader" else word for word in self.arguments)
        return ProcessSpec(self.name, (*arguments, *self.restart_args), command_prefix=self.command_prefix)


class AdoptedProcess:
    """A process that another one started, with the part of `Popen`'s interface that a group uses."""

    stdin = None

    def __init__(self, known: Identity) -> None:
        self._known = known
        self.pid = known.pid

    def poll(self) -> int | None:
        """Return None while it runs, then `UNKNOWN_CODE`: its exit code is known to its parent only."""
        return None if identify(self.pid) == self._known else UNKNOWN_CODE

    def kill(self) -> None:
        send_signal(self._known, signal.SIGKILL)

    def wait(self) -> int:
        while self.poll() is None:
            clock.sleep(POLL_S)
        return UNKNOWN_CODE


class ProcessGroup:
    """Child processes of one run, by name, each with a log file. All calls come from the main thread."""

    def __init__(self, folder: Path, *, outlive: bool = False, environment: Mapping[str, str] | None = None) -> None:
        """`outlive`: the processes go on when this one dies. `environment` is added to theirs."""
        self._logs = folder / LOGS
        self._logs.mkdir(parents=True, exist_ok=True)
        self._children: dict[str, subprocess.Popen[bytes] | AdoptedProcess] = {}
        self._outlive = outlive
        self._environment = environment

    def start(self, row: ProcessSpec) -> None:
        """Start a process and append its output to its log, if the disk gives one.

        Raises OSError when no process can be created.
        """
        death = None if self._outlive else signal.SIGCONT if row.outlives_launcher else signal.SIGKILL
        stdin = subprocess.PIPE if row.outlives_launcher else subprocess.DEVNULL
        with self._open_log(row.name) as log:
            self._children[row.name] = start(row.arguments, log, death, stdin, row.command_prefix, self._environment)

    def adopt(self, name: str, known: Identity) -> None:
        """Take a running process into the group, as `name`."""
        self._children[name] = AdoptedProcess(known)

    def runs(self, name: str) -> bool:
        child = self._children.get(name)
        return child is not None and child.poll() is None

    def succeeded(self, name: str) -> bool:
        return self._children[name].poll() == 0

    def failed(self, name: str) -> bool:
        """Return True if `name` ended with an exit code other than 0 (success) and 2 (bad input)."""
        child = self._children.get(name)
        return child is not None and child.poll() not in (None, 0, 2)

    def exit_of(self, name: str) -> str | None:
        """Return a text on how `name` ended; None while it runs, and before it was started."""
        code = self.code(name)
        if code is None:
            return None
        if code == UNKNOWN_CODE:
            return f"{name} ended (an earlier supervisor started it: how is not known)"
        how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        last_line = self._last_line(name)
        return f"{name} ended ({how})" + (f": {last_line}" if code > 0 and last_line else "")

    def code(self, name: str) -> int | None:
        """Return the exit code as `Popen` gives it, negative for a signal; None while running or not yet started."""
        child = self._children.get(name)
        return None if child is None else child.poll()

    def pid(self, name: str) -> int:
        """Return the pid of `name`, 0 while it does not run."""
        return self._children[name].pid if self.runs(name) else 0

    def log(self, name: str) -> Path:
        return self._logs / f"{name}.log"

    def signal(self, name: str, number: signal.Signals) -> bool:
        """Signal `name` after checking that it is still the started process; return False when it has ended."""
        identity = self.identity(name)
        return identity is not None and send_signal(identity, number)

    def write_line(self, name: str, line: bytes) -> None:
        """Write a line to the standard input of `name` and close it; no effect if the process has ended."""
        stdin = self._children[name].stdin
        if stdin is None or stdin.closed:
            return
        try:
            stdin.write(line + b"\n")
            stdin.close()
        except BrokenPipeError:
            pass

    def terminate(self, names: Sequence[str], grace_s: float = GRACE_S) -> None:
        """Send SIGTERM (and SIGCONT, for stopped ones) to all `names`, and SIGKILL to the rest after `grace_s` [s]."""
        for name in names:
            self.signal(name, signal.SIGTERM)
            self.signal(name, signal.SIGCONT)
        self.wait(names, grace_s)
        for name in names:
            if self.runs(name):
                self._children[name].kill()
        self.wait(names, grace_s)

    def wait(self, names: Sequence[str], timeout_s: float) -> bool:
        """Wait until all `names` have ended; return False if that takes longer than `timeout_s` [s]."""
        until = clock.now() + timeout_s
        while any(self.runs(name) for name in names):
            if clock.now() > until:
                return False
            clock.sleep(POLL_S)
        return True

    def kill_all(self) -> None:
        """Kill every child with SIGKILL and wait for it. For the cleanup after an internal error."""
        for child in self._children.values():
            child.kill()
        for child in self._children.values():
            child.wait()

    def identity(self, name: str) -> Identity | None:
        """Return the identity of `name`, None while it does not run. A child keeps its pid until it is waited for."""
        return identify(self._children[name].pid) if self.runs(name) else None

    def _open_log(self, name: str) -> IO[bytes]:
        try:
            return self.log(name).open("ab")
        except OSError:  # the process is more important than its log
            return open(os.devnull, "ab")

    def _last_line(self, name: str) -> str:
        try:
            with self.log(name).open("rb") as log:
                log.seek(max(0, log.seek(0, os.SEEK_END) - LAST_BYTES))
                lines = log.read(LAST_BYTES).decode(errors="replace").strip().splitlines()
        except OSError:
            return ""
        return lines[-1] if lines else ""
