"""HTTP server of a page for few readers: a client that says its request slowly, or none, keeps nobody else from it."""

from __future__ import annotations

import socket
import threading
from contextlib import suppress
from http.server import ThreadingHTTPServer
from typing import Any

REQUEST_S = 2.0
"""Time [s] for a request and its answer."""
CONNECTIONS_MAX = 32
"""Maximum number of connections at once; the oldest gives way."""


class MetricsServer(ThreadingHTTPServer):
    """A thread for each connection, few at once, each for a short time."""

    daemon_threads = True

    def __init__(self, *arguments: Any) -> None:
        self._open: dict[socket.socket, threading.Timer] = {}
        """Connections with the timers that end them, oldest first; only the server's own thread changes it."""
        super().__init__(*arguments)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer in a thread of its own, and end the connection when its time is over."""
        self._open = {link: timer for link, timer in self._open.items() if timer.is_alive() and link.fileno() >= 0}
        if len(self._open) >= CONNECTIONS_MAX:
            oldest = next(iter(self._open))
            self._open.pop(oldest).cancel()
            _end(oldest)
        timer = threading.Timer(REQUEST_S, _end, (request,))
        timer.daemon = True
        timer.start()
        self._open[request] = timer
        super().process_request(request, client_address)


def _end(link: socket.socket) -> None:
    with suppress(OSError):
        link.shutdown(socket.SHUT_RDWR)
