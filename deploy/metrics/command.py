"""`lfa metrics`: serve a running fleet's state as OpenMetrics text on localhost, or print it once."""

from __future__ import annotations

import sys
import threading
from http.server import BaseHTTPRequestHandler
from pathlib import Path
from typing import Annotated

import typer

from lfa.deploy.client.session import Subscriber, find, listen
from lfa.deploy.metrics.collector import FAMILIES, FleetMetrics
from lfa.deploy.metrics.exposition import CONTENT_TYPE, openmetrics
from lfa.deploy.metrics.page_server import MetricsServer
from lfa.deploy.process.signals import Interrupts
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.output import write_line

LISTEN = "127.0.0.1:9464"
PORT_MAX = 65535
POLL_S = 0.1
FIRST_S = 1.3
"""Time [s] to listen before the text is printed once: each process has published its status by then."""
TOPICS = frozenset({"*/*", "*/*/*"})


def command(
    listen_at: Annotated[str, typer.Option("--listen", help="Address and port of the HTTP server.")] = LISTEN,
    once: Annotated[bool, typer.Option("--once", help="Print the text once and exit.")] = False,
    fleet: Annotated[str | None, typer.Option(help="Name of the fleet; required when several run here.")] = None,
    connect: Annotated[str | None, typer.Option(help="Endpoint of a router; default the fleet's own here.")] = None,
    keys: Annotated[Path | None, typer.Option(help="Folder written by lfa keys, for a secured fleet.")] = None,
) -> int:
    address = listen_address(listen_at)
    found = find(fleet, connect, keys)
    with listen(found, TOPICS) as subscriber:
        page = _Page(subscriber, FleetMetrics(found.name))
        if once:
            page.hear(FIRST_S)
            write_line(page.text().rstrip("\n"), sys.stdout)
            return 0
        _serve(page, address, found.name)
    return 0


def listen_address(text: str) -> tuple[str, int]:
    """Return host and port of `127.0.0.1:9464`. Raises Refused."""
    host, _, port = text.rpartition(":")
    if not host or not port.isascii() or not port.isdecimal() or not 0 < int(port[:6]) <= PORT_MAX:
        raise Refused(f"--listen {text}: must be an address and a port, such as {LISTEN}")
    return host, int(port)


class _Page:
    """The text, from the newest messages. The server's thread reads it while the main thread hears."""

    def __init__(self, subscriber: Subscriber, metrics: FleetMetrics) -> None:
        self._subscriber = subscriber
        self._metrics = metrics
        self._lock = threading.Lock()

    def hear(self, duration_s: float) -> None:
        until = clock.now() + duration_s
        while (left_s := until - clock.now()) > 0.0:
            self._subscriber.wait(min(left_s, POLL_S))
            with self._lock:
                for arrival, message in self._subscriber.take():
                    size = len(arrival.payload) if isinstance(arrival.payload, bytes) else 0
                    self._metrics.update(arrival.at, arrival.key, size, message)
            clock.sleep(min(POLL_S, max(0.0, until - clock.now())))

    def text(self) -> str:
        with self._lock:
            return openmetrics(FAMILIES, self._metrics.samples(clock.now(), self._subscriber.dropped))


def _serve(page: _Page, address: tuple[str, int], fleet: str) -> None:
    """Serve until Ctrl-C or SIGTERM. Raises Refused when the address cannot be listened at."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            if self.path.partition("?")[0] != "/metrics":
                self.send_error(404, "only /metrics is here")
                return
            body = page.text().encode()
            self.send_response(200)
            self.send_header("Content-Type", CONTENT_TYPE)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_: object) -> None:
            """Print nothing: a scrape a second would fill a log."""

    try:
        server = MetricsServer(address, Handler)
    except (OSError, OverflowError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise Refused(f"--listen {address[0]}:{address[1]}: {why}: must be a free address of this machine") from None
    server.handle_error = lambda *_: None  # type: ignore[method-assign]  # a client that went away is no failure here
    threading.Thread(target=server.serve_forever, daemon=True).start()
    write_line(f"metrics of fleet {fleet} at http://{address[0]}:{address[1]}/metrics", sys.stdout)
    with Interrupts() as interrupts:
        while interrupts.signal is None:
            page.hear(POLL_S)
    server.shutdown()
    server.server_close()
