"""Server of the page: its few files over HTTP, and one WebSocket for each viewer.

Who knows the operator's token may give orders, who knows the viewers' may look. A viewer gets the newest frame whenever
it has taken the one before: a slow one misses frames and holds nobody up. Nothing on the page comes from another place.
"""

from __future__ import annotations

import asyncio
import ssl
from collections.abc import Callable
from hmac import compare_digest
from http import HTTPStatus
from ipaddress import ip_address
from pathlib import Path
from time import perf_counter
from urllib.parse import parse_qs, urlsplit

import msgspec
from msgspec import Struct
from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from lfa.deploy.web.engine import Engine
from lfa.protocol.errors import Refused

PAGE = Path(__file__).parent / "page"
TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".json": "application/json"}
FRAME_S = 1.0 / 30.0
VIEWERS_MAX = 32
ORDER_BYTES_MAX = 64 * 1024
SLOW_S_MAX = 10.0
"""Time [s] for which a viewer may take nothing before it is let go."""
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Content security policy: nothing but the page's own files runs, whatever a name or an event contains."""
NEEDS_TOKEN = "this address needs its token: open the line that lfa web printed\n"

encode = msgspec.json.Encoder().encode


class PageTokens(Struct, frozen=True):
    """Secrets of the two kinds of address."""

    operator: str
    viewer: str

    def rights(self, token: str) -> str | None:
        """Return `operate` or `view`, None for a wrong token; takes the same time for all."""
        given = token.encode()
        operates, views = compare_digest(given, self.operator.encode()), compare_digest(given, self.viewer.encode())
        return "operate" if operates else "view" if views else None


class PageServer:
    """One engine and its viewers."""

    def __init__(self, engine: Engine, tokens: PageTokens, clip: bytes = b"") -> None:
        """`clip` is what `clip.json` answers, for the page of a recording."""
        self._engine = engine
        self._tokens = tokens
        self._clip = clip
        self._files = {path.name: path.read_bytes() for path in PAGE.iterdir() if path.suffix in TYPES}
        self._viewers = 0
        self._version = 0
        self._fresh = asyncio.Condition()
        self._frame = b""
        self.host = ""
        self.port = 0

    async def run(self, host: str, port: int, secure: ssl.SSLContext | None, ready: Callable[[], None]) -> None:
        """Serve until cancelled; `ready` is called once the port is open. Raises Refused for a port in use."""
        try:
            server = await serve(
                self._attend, host, port, ssl=secure, process_request=self._answer, compression=None,
                max_size=ORDER_BYTES_MAX, ping_interval=20.0, ping_timeout=20.0, write_limit=1 << 16,
                server_header=None,
            )  # fmt: skip
        except OSError as error:
            why = "in use" if error.errno == 98 else error.strerror or str(error)
            raise Refused(f"--port {port} on {host}: {why}, must be a free one (--port 0 takes any)") from None
        async with server:
            self._named(server, host)
            ready()
            while True:
                began = perf_counter()
                self._engine.advance()
                await self._publish()
                await asyncio.sleep(max(0.002, FRAME_S - (perf_counter() - began)))

    def _named(self, server: Server, host: str) -> None:
        self.host, self.port = host, next(iter(server.sockets)).getsockname()[1]

    async def _publish(self) -> None:
        """Make the frame that the viewers are sent next; without viewers none is made."""
        if self._viewers:
            frames = [picture.frame() for picture in self._engine.pictures]
            self._frame = encode({"number": self._engine.number, "frames": frames, "state": self._engine.state()})
        async with self._fresh:
            self._version += 1
            self._fresh.notify_all()

    # --- HTTP -----------------------------------------------------------------------------------------------------

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Answer a request for a file; return None to let a WebSocket begin."""
        where = urlsplit(request.path)
        rights = self._tokens.rights(next(iter(parse_qs(where.query).get("token", [])), ""))
        host = request.headers.get("Host", "")
        if not self._is_own(host):
            return _plain(HTTPStatus.FORBIDDEN, "this server does not go by that name\n")
        name = where.path.lstrip("/") or "index.html"
        if name == "ws":
            origin = urlsplit(request.headers.get("Origin", ""))
            if rights is None or origin.netloc != host:
                return _plain(HTTPStatus.FORBIDDEN, NEEDS_TOKEN if rights is None else "another page's request\n")
            if self._viewers >= VIEWERS_MAX:
                return _plain(HTTPStatus.SERVICE_UNAVAILABLE, f"{VIEWERS_MAX} viewers look already\n")
            return None
        if name in ("index.html", "clip.json") and rights is None:
            return _plain(HTTPStatus.FORBIDDEN, NEEDS_TOKEN)
        body = self._clip if name == "clip.json" and self._clip else self._files.get(name)
        if body is None:
            return _plain(HTTPStatus.NOT_FOUND, "no such file\n")
        return _response(HTTPStatus.OK, TYPES[Path(name).suffix], body)

    def _is_own(self, host: str) -> bool:
        """Return whether a request names this server: a page elsewhere whose name was made to point here does not."""
        name = urlsplit(f"//{host}").hostname or ""
        if not is_loopback(self.host):
            return True
        return name == "localhost" or is_loopback(name)

    # --- viewers --------------------------------------------------------------------------------------------------

    async def _attend(self, socket: ServerConnection) -> None:
        """Serve one viewer until it goes."""
        assert socket.request is not None
        query = parse_qs(urlsplit(socket.request.path).query)
        rights = self._tokens.rights(query.get("token", [""])[0]) or "view"
        self._viewers += 1
        reader = asyncio.create_task(self._hear(socket, rights))
        try:
            await self._show(socket, rights)
        except (ConnectionClosed, TimeoutError):
            pass
        finally:
            reader.cancel()
            self._viewers -= 1

    async def _show(self, socket: ServerConnection, rights: str) -> None:
        """Send the scene, then frames and news, always the newest."""
        number, version, sent = -1, -1, [0, 0]
        while True:
            if self._engine.number != number:
                number, sent = self._engine.number, [0] * len(self._engine.pictures)
                viewer = self._tokens.viewer if rights == "operate" else ""
                scene = {"scene": self._engine.scene(), "number": number, "rights": rights, "viewer": viewer}
                await _send(socket, encode(scene))
            async with self._fresh:
                await self._fresh.wait_for(lambda last=version: self._version != last)  # type: ignore[misc]
            version, frame = self._version, self._frame
            if self._engine.number != number or not frame:
                continue
            news = [p.news.since(n) for p, n in zip(self._engine.pictures, sent, strict=True)]
            sent = [picture.news.count for picture in self._engine.pictures]
            await _send(socket, frame)
            if any(news):
                await _send(socket, encode({"number": number, "news": news}))

    async def _hear(self, socket: ServerConnection, rights: str) -> None:
        """Carry out a viewer's orders; what cannot be done is answered with one line, and the run goes on."""
        async for text in socket:
            answer: dict[str, object] = {}
            order: object = None
            try:
                order = msgspec.json.decode(text)
                if not isinstance(order, dict):
                    raise Refused("an order must be an object")
                if rights != "operate":
                    raise Refused("this address lets you look only")
                answer = self._engine.obey(order)
            except Refused as refused:
                answer = {"refused": " ".join(str(refused).split())}
            except (msgspec.DecodeError, RecursionError):
                answer = {"refused": "an order must be JSON"}
            if answer:
                await socket.send(encode(answer).decode())


async def _send(socket: ServerConnection, message: bytes) -> None:
    async with asyncio.timeout(SLOW_S_MAX):
        await socket.send(message, text=True)


def is_loopback(name: str) -> bool:
    """Return whether a host name or address is this machine's own."""
    try:
        return name == "localhost" or ip_address(name).is_loopback
    except ValueError:
        return False


def _plain(status: HTTPStatus, text: str) -> Response:
    return _response(status, "text/plain", f"lfa web: {text}".encode())


def _response(status: HTTPStatus, kind: str, body: bytes) -> Response:
    headers = Headers({
        "Content-Type": f"{kind}; charset=utf-8",
        "Content-Length": str(len(body)),
        "Content-Security-Policy": POLICY,
        "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "no-referrer",
        "Cross-Origin-Resource-Policy": "same-origin",
        "Cross-Origin-Opener-Policy": "same-origin",
        "Cache-Control": "no-store",
        "Connection": "close",
    })  # fmt: skip
    return Response(status.value, status.phrase, headers, body)
