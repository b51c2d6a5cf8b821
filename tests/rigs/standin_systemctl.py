"""Stand-in for systemctl and journalctl where PID 1 is no systemd: enough of both for the tests of the interface.

Called as `systemctl`, `journalctl` or `loginctl`. Units lie in `$HOME/.config/systemd/user`, the state in
`$HOME/units.json`; each call first does what systemd would have done meanwhile: notice ends, and restart by Restart=.
"""

from __future__ import annotations

import fcntl
import json
import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

HOME = Path(os.environ["HOME"])
UNITS, STATE, LOGS = HOME / ".config/systemd/user", HOME / "units.json", HOME / "journal"
PARENT = """
import os, subprocess, sys
child = subprocess.Popen(sys.argv[2:])
print(child.pid, flush=True)
os.close(1)
child.wait()
open(sys.argv[1], "w").write(str(child.returncode))
"""
"""Program that starts a unit's process and writes its exit code to a file."""


def main() -> None:
    words = [word for word in sys.argv[1:] if word not in ("--user", "--no-pager", "--no-block", "--now")]
    if Path(sys.argv[0]).name == "journalctl":
        _journal(words)
        return
    if Path(sys.argv[0]).name == "loginctl":
        print("no" if words[0] == "show-user" else "")
        return
    verb, *rest = words
    units = [word for word in rest if not word.startswith("-")]
    members = _members(units)
    with _known() as known:
        _meanwhile(known)
        for unit in (unit for unit in members if unit in known):
            known[unit]["stopped"] = known[unit]["stopped"] or verb in ("stop", "restart")
    if verb in ("stop", "restart", "kill"):  # without the lock: what ends may still ask for the states
        for unit in members:
            _end(known.get(unit), signal.SIGKILL if verb == "kill" else signal.SIGTERM)
    with _known() as known:
        for unit in members:
            if verb == "restart" or (verb == "start" and not _alive(known.get(unit))):
                _start(known, unit)
    if verb == "show":
        print("\n\n".join(_shown(unit, known.get(unit, {})) for unit in units) or "Version=0")


@contextmanager
def _known() -> Iterator[dict[str, dict[str, Any]]]:
    """Provide what is known of the units, alone among all calls, and write it back."""
    with (HOME / "units.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        known: dict[str, dict[str, Any]] = json.loads(STATE.read_text()) if STATE.exists() else {}
        yield known
        STATE.write_text(json.dumps(known))


def _members(units: list[str]) -> list[str]:
    """A target stands for the services that it wants."""
    found: list[str] = []
    for unit in units:
        wanted = _lines(unit).get("Wants", "") if unit.endswith(".target") else unit
        found += wanted.split()
    return found


def _lines(unit: str) -> dict[str, str]:
    pairs = (line.partition("=") for line in (UNITS / unit).read_text().splitlines() if "=" in line)
    return {name: value for name, _, value in pairs}


def _start(known: dict[str, dict[str, Any]], unit: str) -> None:
    LOGS.mkdir(exist_ok=True)
    words = shlex.split(_lines(unit)["ExecStart"].replace("%%", "%").replace("$$", "$"))
    with (LOGS / unit).open("ab") as log:
        code = HOME / f"{unit}.code"
        code.unlink(missing_ok=True)
        watcher = subprocess.Popen(
            [sys.executable, "-c", PARENT, str(code), "sh", "-c", f'exec "$@" >> {shlex.quote(str(LOGS / unit))} 2>&1',
             "sh", *words],
            stdout=subprocess.PIPE, stderr=log, stdin=subprocess.DEVNULL, start_new_session=True,
        )  # fmt: skip
        assert watcher.stdout is not None
        pid = int(watcher.stdout.readline())
    one = known.setdefault(unit, {"restarts": 0, "invocation": 0})
    one |= {"pid": pid, "began": time.monotonic(), "invocation": one["invocation"] + 1, "stopped": False}


def _end(one: dict[str, Any] | None, number: signal.Signals) -> None:
    if one is not None and _alive(one):
        os.kill(one["pid"], number)
        while _alive(one):
            time.sleep(0.01)


def _alive(one: dict[str, Any] | None) -> bool:
    if one is None or not one.get("pid"):
        return False
    try:
        return Path(f"/proc/{one['pid']}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def _code(unit: str) -> int | None:
    path = HOME / f"{unit}.code"
    text = path.read_text() if path.exists() else ""
    return int(text) if text else None


def _meanwhile(known: dict[str, dict[str, Any]]) -> None:
    for unit, one in known.items():
        code = _code(unit)
        if _alive(one) or code is None or one["stopped"] or not (UNITS / unit).exists():
            continue
        again = _lines(unit)["Restart"]
        if code != 2 and (again == "always" or (again == "on-failure" and code != 0)):
            _start(known, unit)
            one["restarts"] += 1


def _shown(unit: str, one: dict[str, Any]) -> str:
    code = _code(unit)
    alive = _alive(one)
    good = code in (None, 0) or one.get("stopped", False)
    facts = {
        "Id": unit,
        "ActiveState": "active" if alive else "inactive" if good else "failed",
        "SubState": "running" if alive else "dead",
        "Result": "success" if alive or good else "exit-code" if (code or 0) > 0 else "signal",
        "MainPID": one.get("pid", 0) if alive else 0,
        "NRestarts": one.get("restarts", 0),
        "InvocationID": one.get("invocation", "") or "",
        "ExecMainCode": 1 if (code or 0) >= 0 else 2,
        "ExecMainStatus": abs(code or 0),
        "ExecMainStartTimestampMonotonic": round(1e6 * one.get("began", 0.0)),
    }
    return "\n".join(f"{name}={value}" for name, value in facts.items())


def _journal(words: list[str]) -> None:
    log = LOGS / words[words.index("--unit") + 1]
    said = log.read_text().splitlines() if log.exists() else []
    after = next((int(word.partition("=")[2]) for word in words if word.startswith("--after-cursor=")), None)
    last = int(words[words.index("--lines") + 1]) if "--lines" in words else 0
    shown = said[after:] if after is not None else said[len(said) - last :] if last else []
    print("\n".join([*shown, f"-- cursor: {len(said)}"]))


if __name__ == "__main__":
    main()
