"""Notifications to systemd: readiness and the watchdog of the loop (sd_notify(3)); none without a NOTIFY_SOCKET."""

from __future__ import annotations

import contextlib


class Notify:
    """Sender of notifications. `address` is the environment's NOTIFY_SOCKET; empty: send nothing."""

    def __init__(self, address: str) -> None:
        self._address = f"\0{address[1:]}" if address.startswith("@") else address

    def ready(self) -> None:
        """Report that the process takes part from now on; the watchdog starts."""
        self._say(b"READY=1")

    def alive(self) -> None:
        """Report that the loop still runs, to reset the watchdog."""
        self._say(b"WATCHDOG=1")

    def _say(self, word: bytes) -> None:
        if not self._address:
            return
        import socket  # not loaded on a robot without systemd

        # Without waiting: a watcher that stands still leaves its queue full, and must not hold up a control loop.
        kind = socket.SOCK_DGRAM | socket.SOCK_NONBLOCK
        with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, kind) as out:
            out.sendto(word, self._address)
