"""systemd as the engine: the units of one machine (`units.py`), by systemctl and journalctl."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from lfa.deploy.fleet.engine.engine import KnownProcess, LogSource, Waitable
from lfa.deploy.fleet.engine.log_tail import LINE_CHARACTERS_MAX, LINES_MAX, LogTail
from lfa.deploy.fleet.engine.units import Scope, unit_of
from lfa.deploy.process.identity import identify
from lfa.deploy.process.process_group import ROUTER_NAME
from lfa.deploy.process.restart_policy import REFUSED_CODE
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.messages.fleet import ProcessReport

LOOK_S = 1.0
"""Interval [s] at which the states of the units are read."""
ANSWER_S = 10.0
"""Longest time [s] that systemctl may take."""
PROPERTIES = (
    "Id", "ActiveState", "SubState", "Result", "MainPID", "NRestarts", "InvocationID", "ExecMainCode", "ExecMainStatus",
    "ExecMainStartTimestampMonotonic",
)  # fmt: skip
CURSOR = "-- cursor: "
_EXITED = "1"
"""ExecMainCode of a process that exited by itself (CLD_EXITED); other values: a signal ended it."""


def systemctl(scope: Scope, *words: str) -> str:
    """Run systemctl and return its output. Raises Refused when it fails."""
    return _run(scope, "systemctl", words)


def _run(scope: Scope, program: str, words: Sequence[str]) -> str:
    command = [program, *(["--user"] if scope == "user" else []), "--no-pager", *words]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=ANSWER_S, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise Refused(f"{' '.join(command)}: {error}: systemd must run on this machine") from None
    if done.returncode != 0:
        said = done.stderr.strip().splitlines()
        raise Refused(f"{' '.join(command[:4])}: {said[-1] if said else f'exit code {done.returncode}'}")
    return done.stdout


def unit_folder(scope: Scope) -> Path:
    """Return the folder of the unit files of the user, or of the machine."""
    return Path.home() / ".config/systemd/user" if scope == "user" else Path("/etc/systemd/system")


def check_here(scope: Scope) -> None:
    """Raise Refused unless systemd runs here, for this user or for the machine."""
    if shutil.which("systemctl") is None:
        raise Refused('engine = systemd: there is no systemctl here, must be "own" on this machine')
    systemctl(scope, "show", "--property=Version")


class SystemdEngine:
    """Engine whose processes are systemd's: it restarts them, and it bounds and watches them."""

    def __init__(self, fleet: str, host: str, names: Sequence[str], scope: Scope) -> None:
        """`names`: of the processes, the router first. The unit files are there already."""
        self.bound = True
        self._units = {name: unit_of(fleet, host, name) for name in names}
        self._scope = scope
        self._shown: dict[str, Mapping[str, str]] = {}
        self._starts: dict[str, int] = {}
        self._look_at = 0.0

    @property
    def names(self) -> Sequence[str]:
        return list(self._units)

    @property
    def wakes(self) -> Sequence[Waitable]:
        return ()

    def start(self, now: float, known: Sequence[KnownProcess] = ()) -> None:
        self._starts = {one.name: one.starts for one in known}
        systemctl(self._scope, "start", "--no-block", *self._units.values())
        self.step(now, router_up=True)

    def step(self, now: float, *, router_up: bool) -> bool:
        """Read the states when that is due; systemd does all else."""
        if now < self._look_at:
            return False
        self._look_at = now + LOOK_S
        before = self._shown
        self._shown = self._show()
        for name, unit in self._shown.items():
            self._count(name, unit, before.get(name, {}))
        return self._shown != before

    def _show(self) -> dict[str, Mapping[str, str]]:
        """Return the properties of each unit by the name of its process; those known before if systemd is silent."""
        wanted = f"--property={','.join(PROPERTIES)}"
        try:
            blocks = systemctl(self._scope, "show", wanted, *self._units.values()).strip().split("\n\n")
        except Refused:
            return self._shown
        units = [dict(line.partition("=")[::2] for line in block.splitlines()) for block in blocks]
        by_unit = {unit.get("Id", ""): unit for unit in units}
        return {name: by_unit[unit] for name, unit in self._units.items() if unit in by_unit}

    def _count(self, name: str, unit: Mapping[str, str], before: Mapping[str, str]) -> None:
        """Count a start for each new invocation, and for those that systemd counted in between."""
        if unit["InvocationID"] == before.get("InvocationID") or not unit["InvocationID"]:
            return
        more = _number(unit, "NRestarts") - _number(before, "NRestarts") if before else _number(unit, "NRestarts") + 1
        known = self._starts.get(name, 0)
        self._starts[name] = known if not before and known else known + max(1, more)

    def restart(self, name: str, now: float) -> None:
        self._look_at = now
        systemctl(self._scope, "reset-failed", self._units[name])
        systemctl(self._scope, "restart", "--no-block", self._units[name])

    def stop(self, now: float, *, router: bool) -> None:
        self._look_at = now
        systemctl(self._scope, "stop", *(unit for name, unit in self._units.items() if (name == ROUTER_NAME) == router))
        self.step(now, router_up=False)

    def kill(self) -> None:
        systemctl(self._scope, "kill", "--signal=SIGKILL", *self._units.values())

    def close(self) -> None:
        """Free nothing: systemd holds all."""

    def states(self, now: float) -> tuple[ProcessReport, ...]:
        return tuple(self._report(name, self._shown.get(name, {}), now) for name in self._units)

    def _report(self, name: str, unit: Mapping[str, str], now: float) -> ProcessReport:
        pid = _number(unit, "MainPID")
        up_s = max(0.0, now - _number(unit, "ExecMainStartTimestampMonotonic") / 1e6)
        began_ms = clock.wall_ms() - round(1000.0 * up_s)
        state = _state(unit)
        ended = "" if state == "running" else _ended(name, unit)
        return ProcessReport(
            name, state, pid, self._starts.get(name, 0), began_ms, round(up_s, 1) if pid else 0.0, ended
        )

    def logs(self, name: str, lines: int, now: float) -> LogSource:
        return JournalTail(self._scope, self._units[name], lines, now)

    def known(self) -> Iterator[KnownProcess]:
        for report in self.states(clock.now()):
            found = identify(report.pid) if report.pid else None
            if found is not None:
                yield KnownProcess(report.name, found, report.starts, 0)


def _number(unit: Mapping[str, str], name: str) -> int:
    text = unit.get(name, "")
    return int(text) if text.isdecimal() else 0


def _state(unit: Mapping[str, str]) -> str:
    """Return the state of a process in the words of `ProcessReport`."""
    match unit.get("ActiveState"):
        case "active" | "reloading" | "deactivating":
            return "running"
        case "activating" if _number(unit, "MainPID"):
            return "running"
        case "activating":
            return "waiting"
    if unit.get("ExecMainCode") == _EXITED and _number(unit, "ExecMainStatus") == REFUSED_CODE:
        return "refused"
    return "ended" if unit.get("Result") == "success" else "failed"


def _ended(name: str, unit: Mapping[str, str]) -> str:
    if unit.get("Result") == "watchdog":
        return f"{name} hung: no sign of life; killed by systemd"
    if unit.get("Result") in ("success", ""):
        return ""
    status = unit.get("ExecMainStatus", "")
    how = f"exit code {status}" if unit.get("ExecMainCode") == _EXITED else f"signal {status}"
    return f"{name} ended ({how})"


class JournalTail(LogTail):
    """Tail of a unit in the journal, by journalctl's cursor."""

    def __init__(self, scope: Scope, unit: str, lines: int, now: float) -> None:
        self._scope = scope
        self._unit = unit
        self._cursor = ""
        super().__init__(self._read("--lines", str(min(lines, LINES_MAX))), now)

    def _appended(self) -> tuple[str, ...]:
        return self._read(*([f"--after-cursor={self._cursor}"] if self._cursor else ["--lines", "0"]))

    def _read(self, *words: str) -> tuple[str, ...]:
        wanted = ("--unit", self._unit, "--output", "cat", "--show-cursor", *words)
        try:
            said = _run(self._scope, "journalctl", wanted).splitlines()
        except Refused:
            return ()
        self._cursor = next((line.removeprefix(CURSOR) for line in said if line.startswith(CURSOR)), self._cursor)
        texts = [line for line in said if not line.startswith("-- ")]
        return tuple(line[:LINE_CHARACTERS_MAX] for line in texts[-LINES_MAX:])
