"""Telling systemd that a process is ready, and that its loop still turns (sd_notify(3)); silent where nobody asks."""

from __future__ import annotations

import contextlib


class Notify:
    """`address` is the environment's NOTIFY_SOCKET; empty: nobody listens."""

    def __init__(self, address: str) -> None:
        self._address = f"\0{address[1:]}" if address.startswith("@") else address

    def ready(self) -> None:
        """It takes part from now on; the watchdog's time begins."""
        self._say(b"READY=1")

    def alive(self) -> None:
        """The loop has turned."""
        self._say(b"WATCHDOG=1")

    def _say(self, word: bytes) -> None:
        if not self._address:
            return
        import socket  # a robot without systemd does not carry it

        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as out, contextlib.suppress(OSError):
            out.sendto(word, self._address)
