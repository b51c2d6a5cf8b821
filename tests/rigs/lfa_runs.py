"""Runs of the `lfa` command in processes, with a check for processes and sockets that remain afterwards."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from lfa.deploy.process.identity import Identity, identify, own_processes
from lfa.protocol import clock

SHORT = ("--set", "mission.leading.route_m=[[2.0, 0.0]]")
PATIENCE_S = 30.0
POLL_S = 0.02
LFA = (sys.executable, "-c", "from lfa.deploy.cli import main; main()")


def lfa(*arguments: str, timeout_s: float = 90.0) -> subprocess.CompletedProcess[str]:
    """Run `lfa ARGUMENTS` to its end."""
    return subprocess.run([*LFA, *arguments], capture_output=True, text=True, timeout=timeout_s, check=False)


class Running:
    """One `lfa run` in the background, with its folder, processes and sockets."""

    def __init__(self, folder: Path, arguments: tuple[str, ...]) -> None:
        self.folder = folder
        command = [*LFA, "run", *arguments, "--out", str(folder), "--no-figures"]
        self.launcher = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self._known: dict[str, Identity] = {}
        self.sockets = Path()

    def group(self) -> dict[str, Identity]:
        """Return the launcher's children by name, including those known from earlier calls."""
        for identity in own_processes():
            if _parent(identity.pid) == self.launcher.pid and "-m" in identity.arguments:
                self._known[_name(identity.arguments)] = identity
        router = self._known.get("router")
        if router is not None:
            self.sockets = Path(router.arguments[-1].removeprefix("unixsock-stream/")).parent
        return self._known

    def wait_for(self, kind: str) -> None:
        """Wait until an event of `kind` is in the run folder."""
        eventually(lambda: any(line["kind"] == kind for line in self.events()), f"no event {kind!r} came")
        self.group()

    def events(self) -> list[dict[str, Any]]:
        path = self.folder / "events.jsonl"
        return (
            [json.loads(line) for line in path.read_text().splitlines(True) if line.endswith("\n")]
            if path.exists()
            else []
        )

    def left(self) -> list[str]:
        """Return the processes and sockets of this run that still exist."""
        processes = [name for name, identity in self._known.items() if identify(identity.pid) == identity]
        return processes + ([str(self.sockets)] if self.sockets.name and self.sockets.exists() else [])

    def summary(self) -> dict[str, Any]:
        facts: dict[str, Any] = json.loads((self.folder / "summary.json").read_text())
        return facts


@contextmanager
def running(folder: Path, *arguments: str) -> Iterator[Running]:
    """Start a run in the background; at the end of the block its remaining processes, and only those, are killed."""
    run = Running(folder, arguments)
    try:
        yield run
    finally:
        run.group()
        run.launcher.kill()
        run.launcher.communicate()
        for identity in run._known.values():
            if identify(identity.pid) == identity:
                os.kill(identity.pid, 9)


def eventually(holds: Callable[[], bool], complaint: str | Callable[[], str], within_s: float = PATIENCE_S) -> None:
    """Wait until `holds()`, failing with `complaint` after `within_s`."""
    until = clock.now() + within_s
    while not holds():
        if clock.now() >= until:
            pytest.fail(f"{complaint if isinstance(complaint, str) else complaint()} within {within_s:g} s")
        clock.sleep(POLL_S)


def _parent(pid: int) -> int:
    try:
        return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])
    except OSError:
        return 0


def _name(arguments: tuple[str, ...]) -> str:
    module = arguments[arguments.index("-m") + 1]
    if module == "lfa.agents.cli":
        return f"robot{arguments[arguments.index('--id') + 1]}"
    return {"lfa.world.cli": "world", "lfa.deploy.run.recorder_process": "recorder"}.get(module, module.split(".")[-1])
