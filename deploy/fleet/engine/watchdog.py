"""Watchdog of supervised processes: who showed no sign of life in time, and the socket that takes the signs.

The signs are those of systemd (sd_notify(3)): datagrams READY=1 and WATCHDOG=1 on the socket NOTIFY_SOCKET. The kernel
adds the sender's pid, so that no process can report for another one.
"""

from __future__ import annotations

import contextlib
import socket
import struct
from pathlib import Path

from lfa.protocol.errors import Refused

START_S = 60.0
"""Time [s] from the start of a process to its first sign of life; a busy machine imports for several seconds."""
STANDSTILL_S = 1.0
"""Gap [s] between two looks from which the watcher itself stood still; it then knows nothing about the others."""
SIGN_BYTES_MAX = 4096
SIGNS_MAX = 4096
"""Number of signs taken at a time, so that a process that sends them endlessly does not hold its watcher up."""
_CREDENTIALS = struct.Struct("3i")  # pid, uid, gid: struct ucred of unix(7)


class SignSocket:
    """Socket at `path` that processes send signs of life to; they find it anew after their watcher was replaced."""

    def __init__(self, path: Path) -> None:
        """Open the socket in place of an earlier one. Raises Refused."""
        self._path = path
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        try:
            path.unlink(missing_ok=True)
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_PASSCRED, 1)
            self._socket.bind(str(path))
        except OSError as error:
            self._socket.close()
            raise Refused(f"{path}: {error.strerror or error}: must be in a folder to write to") from None

    def fileno(self) -> int:
        return self._socket.fileno()

    def take(self) -> set[int]:
        """Return the pids of the processes that sent a sign of life since the last call."""
        alive = set()
        with contextlib.suppress(BlockingIOError):
            for _ in range(SIGNS_MAX):
                sign, notes, _, _ = self._socket.recvmsg(SIGN_BYTES_MAX, socket.CMSG_SPACE(_CREDENTIALS.size))
                for level, kind, data in notes:
                    if (level, kind) == (socket.SOL_SOCKET, socket.SCM_CREDENTIALS) and _is_life(sign):
                        alive.add(_CREDENTIALS.unpack(data[: _CREDENTIALS.size])[0])
        return alive

    def close(self) -> None:
        self._socket.close()
        with contextlib.suppress(OSError):
            self._path.unlink(missing_ok=True)


def _is_life(sign: bytes) -> bool:
    return any(line in (b"WATCHDOG=1", b"READY=1") for line in sign.splitlines())


class HangDetector:
    """Times by which processes must have shown a sign of life, at the latest `limit_s` [s] apart. Pure."""

    def __init__(self, limit_s: float) -> None:
        self.limit_s = limit_s
        self._due: dict[str, float] = {}
        self._looked_at: float | None = None

    def started(self, name: str, now: float) -> None:
        self._due[name] = now + START_S + self.limit_s

    def alive(self, name: str, now: float) -> None:
        if name in self._due:
            self._due[name] = now + self.limit_s

    def ended(self, name: str) -> None:
        self._due.pop(name, None)

    def hung(self, now: float) -> list[str]:
        """Return the processes whose sign of life is overdue, each until it is started again.

        Once the watcher itself stood still, all get the whole time again: it may not have taken their signs.
        """
        before, self._looked_at = self._looked_at, now
        if before is not None and now - before > STANDSTILL_S:
            self._due = {name: max(due, now + self.limit_s) for name, due in self._due.items()}
        late = [name for name, due in self._due.items() if now > due]
        for name in late:
            del self._due[name]
        return late
