"""Processes of this machine, identified by more than the pid, since the kernel may reuse a pid.

Linux only: /proc and pidfd. `send` opens a pidfd first and then checks the identity behind it; from then on the kernel
guarantees that the pidfd refers to that process.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO

from msgspec import Struct

TETHER = Path(__file__).with_name("parent_death.py")


class Identity(Struct, frozen=True):
    """Properties that identify a process while it runs: pid, start time [ticks since boot], user id, command line."""

    pid: int
    started: int
    user: int
    arguments: tuple[str, ...]


def identify(pid: int) -> Identity | None:
    """Return the identity of the process that has `pid` now; None when there is none or it is a zombie."""
    proc = Path(f"/proc/{pid}")
    try:
        state, *rest = (proc / "stat").read_text().rpartition(")")[2].split()
        arguments = (proc / "cmdline").read_bytes().rstrip(b"\0").decode(errors="replace").split("\0")
        user = proc.stat().st_uid
    except OSError:
        return None
    return None if state in "ZX" else Identity(pid, int(rest[18]), user, tuple(arguments))


def cpu_s(identity: Identity) -> float:
    """Return the processor time [s] used so far by all threads of a process. Raises OSError when it has ended."""
    fields = Path(f"/proc/{identity.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def send_signal(identity: Identity, number: signal.Signals) -> bool:
    """Signal exactly that process; return False when it has ended."""
    try:
        handle = os.pidfd_open(identity.pid)
    except ProcessLookupError:
        return False
    try:
        if identify(identity.pid) != identity:
            return False
        signal.pidfd_send_signal(handle, number)
    except ProcessLookupError:
        return False
    finally:
        os.close(handle)
    return True


def own_processes() -> Iterator[Identity]:
    """Yield all processes of this user, by pid."""
    for entry in sorted(Path("/proc").glob("[0-9]*"), key=lambda path: int(path.name)):
        identity = identify(int(entry.name))
        if identity is not None and identity.user == os.getuid():
            yield identity


def start(
    arguments: Sequence[str],
    log: IO[bytes],
    on_parent_death: signal.Signals | None = signal.SIGKILL,
    stdin: int = subprocess.DEVNULL,
    inside: Sequence[str] = (),
    environment: Mapping[str, str] | None = None,
) -> subprocess.Popen[bytes]:
    """Start `python -P -m ARGUMENTS` as a child in its own session, which the terminal's Ctrl-C does not reach.

    The child receives `on_parent_death` when this process dies; None: nothing, it goes on. `inside` is a command prefix
    that executes the child elsewhere, such as `/sbin/ip netns exec NAME`. `environment` is added to this process's own.

    Call it from the main thread: for the kernel, the parent of a child is the thread that started it.
    """
    python = sys.executable
    tether = [python, "-I", "-S", str(TETHER), str(os.getpid()), str(int(on_parent_death))] if on_parent_death else []
    command = [*tether, *inside, python, "-P", "-m", *arguments]
    around = {**os.environ, **(environment or {})}
    return subprocess.Popen(command, stdin=stdin, stdout=log, stderr=log, start_new_session=True, env=around)
