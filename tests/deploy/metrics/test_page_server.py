"""The server of a page answers, whoever else stands at its door."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack
from http.server import BaseHTTPRequestHandler
from urllib.request import urlopen

import pytest

from lfa.deploy.metrics.page_server import CONNECTIONS_MAX, MetricsServer


class PageHandler(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        self.send_response(200)
        self.end_headers()
        self.wfile.write(b"page")

    def log_message(self, *_: object) -> None:
        """Print nothing."""


@pytest.fixture
def where() -> Iterator[tuple[str, int]]:
    server = MetricsServer(("127.0.0.1", 0), PageHandler)
    server.handle_error = lambda *_: None  # type: ignore[method-assign]
    threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True).start()
    yield ("127.0.0.1", server.server_address[1])
    server.shutdown()
    server.server_close()


@pytest.mark.parametrize("said", [b"", b"GET /metrics HT"])
def test_silent_and_slow_connections_keep_nobody_from_the_page(said: bytes, where: tuple[str, int]) -> None:
    with ExitStack() as silent:
        for _ in range(3 * CONNECTIONS_MAX):
            silent.enter_context(socket.create_connection(where, 10.0)).sendall(said)
        assert urlopen(f"http://{where[0]}:{where[1]}/metrics", timeout=10.0).read() == b"page"


def test_a_request_that_never_ends_is_ended(where: tuple[str, int]) -> None:
    with socket.create_connection(where, 10.0) as slow:
        slow.sendall(b"GET /metrics HTTP/1.1\r\n")
        assert slow.recv(1) == b""
