"""The processes of one run: a table, started in order, watched, and ended whatever happens."""

from __future__ import annotations

import signal
import subprocess
from collections.abc import Sequence
from pathlib import Path

from msgspec import Struct

from lfa.deploy.process import identity as processes
from lfa.deploy.process.identity import Identity
from lfa.deploy.recording.run_folder import LOGS
from lfa.protocol import clock

ROUTER_NAME = "router"
GRACE_S = 2.0  # between SIGTERM and SIGKILL
POLL_S = 0.01


class ProcessSpec(Struct, frozen=True):
    """One process: what it is called, and `python -m` what."""

    name: str
    arguments: tuple[str, ...]
    outlives_launcher: bool = False
    """It hears of the launcher's death, wakes up if it was stopped, and ends by itself."""
    restart_args: tuple[str, ...] = ()
    """What it is told besides when it starts again."""
    command_prefix: tuple[str, ...] = ()
    """The command that it runs under, such as one that enters a network namespace."""

    def restarted(self) -> ProcessSpec:
        """An agent that starts again starts as a follower, and the others tell it the rest; a world resumes."""
        told = tuple("follower" if word == "leader" else word for word in self.arguments)
        return ProcessSpec(self.name, (*told, *self.restart_args), command_prefix=self.command_prefix)


class ProcessGroup:
    """Those that were started; each has its log. All calls come from the main thread."""

    def __init__(self, folder: Path) -> None:
        self._logs = folder / LOGS
        self._logs.mkdir(parents=True, exist_ok=True)
        self._children: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, row: ProcessSpec) -> None:
        """Raises OSError when no process can be made."""
        death = signal.SIGCONT if row.outlives_launcher else signal.SIGKILL
        stdin = subprocess.PIPE if row.outlives_launcher else subprocess.DEVNULL
        with self.log(row.name).open("ab") as log:
            self._children[row.name] = processes.start(row.arguments, log, death, stdin, row.command_prefix)

    def runs(self, name: str) -> bool:
        child = self._children.get(name)
        return child is not None and child.poll() is None

    def succeeded(self, name: str) -> bool:
        return self._children[name].poll() == 0

    def failed(self, name: str) -> bool:
        """It ended, neither well nor because what it was told was refused."""
        child = self._children.get(name)
        return child is not None and child.poll() not in (None, 0, 2)

    def exit_of(self, name: str) -> str | None:
        """How `name` ended, in words; None while it runs, and before it was started."""
        code = self.code(name)
        if code is None:
            return None
        how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        last_line = self._last_line(name)
        return f"{name} ended ({how})" + (f": {last_line}" if code > 0 and last_line else "")

    def code(self, name: str) -> int | None:
        """As of a `Popen`: negative for a signal; None while it runs, and before it was started."""
        child = self._children.get(name)
        return None if child is None else child.poll()

    def pid(self, name: str) -> int:
        """0 while it does not run."""
        return self._children[name].pid if self.runs(name) else 0

    def log(self, name: str) -> Path:
        return self._logs / f"{name}.log"

    def signal(self, name: str, number: signal.Signals) -> bool:
        """Signal `name`, checked to be still the process that was started; False when it has gone."""
        identity = self.identity(name)
        return identity is not None and processes.send(identity, number)

    def write_line(self, name: str, line: bytes) -> None:
        """Write a line to the standard input of `name` and close it; one that has gone hears nothing."""
        stdin = self._children[name].stdin
        if stdin is None or stdin.closed:
            return
        try:
            stdin.write(line + b"\n")
            stdin.close()
        except BrokenPipeError:
            pass

    def terminate(self, names: Sequence[str], grace_s: float = GRACE_S) -> None:
        """SIGTERM to all of them, SIGKILL to what is left after the grace; stopped ones are woken for it."""
        for name in names:
            self.signal(name, signal.SIGTERM)
            self.signal(name, signal.SIGCONT)
        self.wait(names, grace_s)
        for name in names:
            if self.runs(name):
                self._children[name].kill()
        self.wait(names, grace_s)

    def wait(self, names: Sequence[str], timeout_s: float) -> bool:
        """True as soon as all of them have ended."""
        until = clock.now() + timeout_s
        while any(self.runs(name) for name in names):
            if clock.now() > until:
                return False
            clock.sleep(POLL_S)
        return True

    def kill_all(self) -> None:
        """The last resort, for errors of our own."""
        for child in self._children.values():
            child.kill()
            child.wait()

    def identity(self, name: str) -> Identity | None:
        """A child that has not been waited for keeps its pid: this is who it is now."""
        return processes.identify(self._children[name].pid) if self.runs(name) else None

    def _last_line(self, name: str) -> str:
        lines = self.log(name).read_text(errors="replace").strip().splitlines()
        return lines[-1] if lines else ""
