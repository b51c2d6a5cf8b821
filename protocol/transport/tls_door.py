"""Door before a router's TLS listeners: who does not finish a handshake keeps nobody else from it.

A listener of Zenoh does one handshake after another, and sleeps 0.1 s after each that fails or times out. So ten bad
connections a second from anyone, without any certificate, lock out every new member and every failover. The door
listens in Zenoh's place. A connection waits in the door until its whole ClientHello is there; few wait per address, and
the oldest gives way. Then it gets one of `LISTENERS` listeners on loopback for itself, for `HANDSHAKE_S` at most, less
when all are busy; those wait then whose addresses have failed more often since they last succeeded. An address whose
connections keep failing is let in rarely.
"""

from __future__ import annotations

import selectors
import socket
import threading
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress

from lfa.protocol import clock

LISTENERS = 24
"""Number of handshakes at once."""
HELLO_S = 2.0
"""Time [s] for the whole ClientHello."""
HANDSHAKE_S, HURRIED_S = 1.5, 0.4
"""Time [s] for a handshake from then on: with a free listener, and while others wait for one."""
QUEUED_S = 5.0
"""Time [s] in which a listener must have become free."""
QUEUED_MAX = 8
"""Maximum number of connections of one address that wait for a listener."""
PAUSE_S = 0.12
"""Time [s] for which Zenoh's listener accepts nobody after a handshake that failed."""
WAITING_MAX, WAITING_ALL_MAX = 32, 256
"""Maximum number of silent connections: of one address, and of all."""
FAILED_S = 3.0
"""Lifetime [s] of a connection, up to which its end counts as a failed handshake."""
FAILURES_HZ, FAILURES_BURST = 2.0, 40.0
"""Rate and number of failures at once, per address, above which its connections are refused."""
ADDRESSES_MAX = 1024
RELAY_BYTES = 64 * 1024
STEP_S, BUSY_STEP_S = 0.25, 0.02
HANDSHAKE_RECORD = 0x16
"""First byte of a TLS record with a handshake message (RFC 8446, 5.1)."""
RECORD_HEAD, RECORD_BYTES_MAX = 5, 16384
RETRY = bytes.fromhex("cf21ad74e59a6111be1d8c021e65b891")
"""Beginning of the random value that makes a ServerHello a HelloRetryRequest (RFC 8446, 4.1.3)."""


def hello_length(begun: bytes | bytearray) -> int | None:
    """Return the length [bytes] of the record that `begun` is the beginning of; None when it is no ClientHello's.

    Before its head is there, the head's own length.
    """
    for at, right in ((0, HANDSHAKE_RECORD), (1, 3), (5, 1)):  # handshake, version 3.x, ClientHello
        if len(begun) > at and begun[at] != right:
            return None
    if len(begun) < RECORD_HEAD:
        return RECORD_HEAD + 1
    length = int.from_bytes(begun[3:RECORD_HEAD], "big")
    return RECORD_HEAD + length if 1 <= length <= RECORD_BYTES_MAX else None


class Failures:
    """Bucket of allowed failures of each address. Pure: times are arguments."""

    def __init__(self) -> None:
        self._left: dict[str, tuple[float, float]] = {}
        """Failures that are still allowed, and the time [s] of that number."""
        self._in_turn: dict[str, int] = {}
        """Number of failures since the last success."""

    def refuses(self, address: str, now: float) -> bool:
        """Return True if the address has used up its failures at `now` [s]."""
        return self._of(address, now) < 1.0

    def add(self, address: str, now: float, *, member: bool = False) -> None:
        """Count a failure at `now` [s], or a brief connection of a member."""
        left = self._of(address, now)
        if len(self._left) >= ADDRESSES_MAX:
            self._left.clear()
            self._in_turn.clear()
        self._left[address] = max(left - 1.0, 0.0), now
        self._in_turn[address] = 0 if member else self.in_turn(address) + 1

    def succeed(self, address: str) -> None:
        """Forget the failures of an address."""
        self._left.pop(address, None)
        self._in_turn.pop(address, None)

    def in_turn(self, address: str) -> int:
        """Return the number of failures of the address since its last success."""
        return self._in_turn.get(address, 0)

    def _of(self, address: str, now: float) -> float:
        left, since = self._left.get(address, (FAILURES_BURST, now))
        return min(left + FAILURES_HZ * max(now - since, 0.0), FAILURES_BURST)


class Waiting:
    """Connections in the order of their arrival, with their addresses. Pure: times are arguments."""

    def __init__(self, each_max: int = WAITING_MAX, limit_s: float = HELLO_S) -> None:
        """`each_max` connections of one address may wait for `limit_s` [s]."""
        self._each_max, self._limit_s = each_max, limit_s
        self._since: dict[int, tuple[str, float]] = {}
        """Address and arrival [s] of each connection, by its number, oldest first."""

    def __len__(self) -> int:
        return len(self._since)

    def add(self, number: int, address: str, now: float) -> int | None:
        """Add a connection; return the one that must give way to it, if any: the oldest of its address, or of all."""
        own = [other for other, (at, _) in self._since.items() if at == address]
        yields = own[0] if len(own) >= self._each_max else None
        if yields is None and len(self._since) >= WAITING_ALL_MAX:
            yields = next(iter(self._since))
        if yields is not None:
            del self._since[yields]
        self._since[number] = address, now
        return yields

    def remove(self, number: int) -> None:
        self._since.pop(number, None)

    def first(self, failures: Failures) -> int:
        """Return the connection whose address has failed least since its last success, of these the oldest."""
        return min(self._since, key=lambda number: failures.in_turn(self._since[number][0]))

    def overdue(self, now: float) -> list[int]:
        """Return the connections that have waited for longer than their limit."""
        return [number for number, (_, since) in self._since.items() if now - since > self._limit_s]


class Visitor:
    """A connection from outside."""

    def __init__(self, link: socket.socket, address: str) -> None:
        self.link, self.address = link, address
        self.said = bytearray()
        """What it has said before a listener heard it."""


class Handshake:
    """Progress of a handshake, as the bytes that pass show it: the client answers, and the server answers that."""

    def __init__(self) -> None:
        self._asks = 0
        """Number of answers that the client still owes, once the server has spoken."""
        self._server_spoke = self._client_answered = self.finished = False
        self.member = False
        """True: the server has answered the client after the handshake, which it does to one with a certificate."""

    def client_spoke(self, _data: bytes) -> None:
        self._client_answered = self._server_spoke

    def server_spoke(self, data: bytes) -> None:
        if not self._server_spoke:
            self._server_spoke, self._asks = True, 2 if RETRY in data else 1
        elif self._client_answered:
            self._asks, self._client_answered = self._asks - 1, False
            self.member = self.finished
            self.finished = self._asks <= 0


class TlsDoor:
    """Listener at a public address that relays to the `inner` ones, in threads of its own until `close`."""

    def __init__(self, host: str, port: int, inner: Sequence[tuple[str, int]]) -> None:
        """Listen and start. Raises OSError if the address is taken."""
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._socket = socket.create_server((host, port), family=family, backlog=1024)
        self._socket.setblocking(False)
        self._free = dict.fromkeys(inner, 0.0)
        """Listeners without a handshake, each with the time [s] from which it accepts."""
        self._failures = Failures()
        self._silent, self._queued = Waiting(), Waiting(QUEUED_MAX, QUEUED_S)
        self._visitors: dict[int, Visitor] = {}
        """Those who wait for their ClientHello, or for a listener."""
        self._shaking: dict[socket.socket, float] = {}
        """Time [s] by which the handshake of a connection must be finished."""
        self._told: deque[Callable[[], None]] = deque()
        """What the relays, each in its thread, have to tell."""
        self._selector = selectors.DefaultSelector()
        self._closing = False
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop listening; relays end with their connections."""
        self._closing = True
        self._thread.join(2.0 * STEP_S)
        self._socket.close()

    def _serve(self) -> None:
        self._selector.register(self._socket, selectors.EVENT_READ)
        while not self._closing:
            for key, _ in self._selector.select(BUSY_STEP_S if self._queued else STEP_S):
                if key.fileobj is self._socket:
                    self._accept(clock.now())
                else:
                    self._hear(key.fd, clock.now())
            while self._told:
                self._told.popleft()()
            self._look_at_times(clock.now())
            self._let_in(clock.now())

    def _accept(self, now: float) -> None:
        try:
            link, where = self._socket.accept()
        except OSError:  # gone again, or no file is left: the oldest silent one gives way at its time
            return
        address = where[0]
        if self._failures.refuses(address, now):
            link.close()
            return
        link.setblocking(False)
        self._visitors[link.fileno()] = Visitor(link, address)
        self._drop(self._silent.add(link.fileno(), address, now))
        self._selector.register(link, selectors.EVENT_READ)

    def _hear(self, number: int, now: float) -> None:
        """Let a connection wait for a listener whose ClientHello is there; drop one that says another thing."""
        if number not in self._visitors:  # it gave way in this very round
            return
        visitor = self._visitors[number]
        wanted = hello_length(visitor.said)
        assert wanted is not None
        try:
            heard = visitor.link.recv(wanted - len(visitor.said))
        except BlockingIOError:  # another one of this number gave way in this very round
            return
        except OSError:
            heard = b""
        visitor.said += heard
        wanted = hello_length(visitor.said)
        if not heard or wanted is None:
            self._drop(number)
        elif len(visitor.said) >= wanted:
            self._silent.remove(number)
            self._selector.unregister(visitor.link)
            self._drop(self._queued.add(number, visitor.address, now))

    def _drop(self, number: int | None) -> None:
        """Show out one who waits; None: nobody."""
        visitor = self._visitors.pop(number, None) if number is not None else None
        if visitor is None or number is None:
            return
        self._silent.remove(number)
        self._queued.remove(number)
        with suppress(KeyError):  # one who waits for a listener is not listened to
            self._selector.unregister(visitor.link)
        with suppress(OSError):  # unread bytes would make the kernel reset the connection, without the end of stream
            visitor.link.recv(RELAY_BYTES, socket.MSG_DONTWAIT)
        visitor.link.close()

    def _look_at_times(self, now: float) -> None:
        """End those who have waited, or shaken hands, for too long."""
        for number in (*self._silent.overdue(now), *self._queued.overdue(now)):
            self._drop(number)
        hurry = HANDSHAKE_S - HURRIED_S if self._queued and not self._free else 0.0
        for link, end in self._shaking.items():
            if now > end - hurry:
                with suppress(OSError):  # its relay tells of the end
                    link.shutdown(socket.SHUT_RDWR)

    def _let_in(self, now: float) -> None:
        """Give each listener that accepts to the next who waits."""
        for inner in [inner for inner, since in self._free.items() if now >= since]:
            if not self._queued:
                return
            number = self._queued.first(self._failures)
            self._queued.remove(number)
            visitor = self._visitors.pop(number)
            del self._free[inner]
            self._shaking[visitor.link] = now + HANDSHAKE_S
            threading.Thread(target=self._relay, args=(visitor, inner, now), daemon=True).start()

    def _finish(self, visitor: Visitor, inner: tuple[str, int], accepts_at: float) -> None:
        """Free the listener of a handshake that was finished, or has ended."""
        if self._shaking.pop(visitor.link, None) is not None:
            self._free[inner] = accepts_at

    def _end(self, visitor: Visitor, inner: tuple[str, int], since: float, shaking: Handshake) -> None:
        """Free the listener of a connection that has ended, and count it."""
        now = clock.now()
        self._finish(visitor, inner, now + PAUSE_S)
        if shaking.member and now - since >= FAILED_S:
            self._failures.succeed(visitor.address)
        else:
            self._failures.add(visitor.address, now, member=shaking.member)

    def _relay(self, visitor: Visitor, inner: tuple[str, int], since: float) -> None:
        """Pass bytes both ways until either end closes."""
        shaking, link = Handshake(), visitor.link

        def server_spoke(data: bytes) -> None:
            shaking.server_spoke(data)
            if shaking.finished and link in self._shaking:
                self._told.append(lambda: self._finish(visitor, inner, 0.0))

        with suppress(OSError), link, socket.create_connection(inner, HELLO_S) as inside:
            for end in (link, inside):
                end.settimeout(None)
                end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            inside.sendall(visitor.said)
            back = threading.Thread(target=_pump, args=(inside, link, server_spoke), daemon=True)
            back.start()
            _pump(link, inside, shaking.client_spoke)
            back.join()
        self._told.append(lambda: self._end(visitor, inner, since, shaking))


def _pump(source: socket.socket, sink: socket.socket, spoke: Callable[[bytes], None]) -> None:
    """Pass bytes one way; at the end close both ways, as the end of a link's process must be seen at once."""
    with suppress(OSError):
        while data := source.recv(RELAY_BYTES):
            spoke(data)
            sink.sendall(data)
    for end in (source, sink):
        with suppress(OSError):
            end.shutdown(socket.SHUT_RDWR)
