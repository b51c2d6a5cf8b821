"""Processes of this machine, known by more than their number: a pid may belong to somebody else by now.

Linux only: /proc and pidfd. Whoever signals takes a pidfd first and then checks who is behind it; from then on the
kernel itself keeps the number from meaning another process.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO

from msgspec import Struct

TETHER = Path(__file__).with_name("parent_death.py")


class Identity(Struct, frozen=True):
    """What a process is, as long as it lives: when it started (ticks since boot), whose it is, what it was told."""

    pid: int
    started: int
    user: int
    arguments: tuple[str, ...]


def identify(pid: int) -> Identity | None:
    """Who `pid` is at the moment, None when there is no such process or it is a zombie."""
    proc = Path(f"/proc/{pid}")
    try:
        state, *rest = (proc / "stat").read_text().rpartition(")")[2].split()
        arguments = (proc / "cmdline").read_bytes().rstrip(b"\0").decode(errors="replace").split("\0")
        user = proc.stat().st_uid
    except OSError:
        return None
    return None if state in "ZX" else Identity(pid, int(rest[18]), user, tuple(arguments))


def cpu_s(identity: Identity) -> float:
    """Processor time [s] that a process has used so far, of all its threads. Raises OSError when it has gone."""
    fields = Path(f"/proc/{identity.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def send(identity: Identity, number: signal.Signals) -> bool:
    """Signal exactly that process; False when it has gone."""
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
    """All processes of this user."""
    for entry in sorted(Path("/proc").glob("[0-9]*"), key=lambda path: int(path.name)):
        identity = identify(int(entry.name))
        if identity is not None and identity.user == os.getuid():
            yield identity


def start(
    arguments: Sequence[str],
    log: IO[bytes],
    on_parent_death: signal.Signals = signal.SIGKILL,
    stdin: int = subprocess.DEVNULL,
    inside: Sequence[str] = (),
) -> subprocess.Popen[bytes]:
    """`python -P -m ARGUMENTS` as a child that hears of our death, out of reach of the terminal's Ctrl-C.

    `inside` is a command that becomes another in a place of its choice, such as `/sbin/ip netns exec NAME`.

    Call it from the main thread: the kernel means the thread that started a child when it speaks of its parent.
    """
    python = sys.executable
    tether = [python, "-I", "-S", str(TETHER), str(os.getpid()), str(int(on_parent_death))]
    command = [*tether, *inside, python, "-P", "-m", *arguments]
    return subprocess.Popen(command, stdin=stdin, stdout=log, stderr=log, start_new_session=True)
