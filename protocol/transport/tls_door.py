"""Door before a router's TLS listener: silent connections and failing ones do not reach Zenoh.

Zenoh sleeps 0.1 s after each TLS handshake that fails or times out, and accepts nobody meanwhile. So ten bad
connections a second from anyone, without any certificate, lock out every new member and every failover. The door
listens in Zenoh's place and relays to its listener on loopback a connection that has begun a handshake. Silent ones
wait in the door, few per address, and the oldest gives way; an address whose connections keep failing is let in rarely.
"""

from __future__ import annotations

import selectors
import socket
import threading
from collections import deque
from contextlib import suppress

from lfa.protocol import clock

HELLO_S = 2.0
"""Time [s] for the first bytes of a handshake."""
WAITING_MAX, WAITING_ALL_MAX = 32, 256
"""Maximum number of silent connections: of one address, and of all."""
FAILED_S = 3.0
"""Lifetime [s] of a connection, up to which its end counts as a failed handshake."""
FAILURES_HZ, FAILURES_BURST = 2.0, 40.0
"""Rate and number of failures at once, per address, above which its connections are refused."""
ADDRESSES_MAX = 1024
RELAY_BYTES = 64 * 1024
STEP_S = 0.25
HANDSHAKE_RECORD = 0x16
"""First byte of a TLS record with a handshake message (RFC 8446, 5.1)."""


class Failures:
    """Bucket of allowed failures of each address. Pure: times are arguments."""

    def __init__(self) -> None:
        self._left: dict[str, tuple[float, float]] = {}
        """Failures that are still allowed, and the time [s] of that number."""

    def refuses(self, address: str, now: float) -> bool:
        """Return True if the address has used up its failures at `now` [s]."""
        return self._of(address, now) < 1.0

    def add(self, address: str, now: float) -> None:
        """Count a failure at `now` [s]."""
        left = self._of(address, now)
        if len(self._left) >= ADDRESSES_MAX:
            self._left.clear()
        self._left[address] = max(left - 1.0, 0.0), now

    def _of(self, address: str, now: float) -> float:
        left, since = self._left.get(address, (FAILURES_BURST, now))
        return min(left + FAILURES_HZ * max(now - since, 0.0), FAILURES_BURST)


class Waiting:
    """Silent connections in the order of their arrival, with their addresses. Pure: times are arguments."""

    def __init__(self) -> None:
        self._since: dict[int, tuple[str, float]] = {}
        """Address and arrival [s] of each connection, by its number, oldest first."""

    def add(self, number: int, address: str, now: float) -> int | None:
        """Add a connection; return the one that must give way to it, if any: the oldest of its address, or of all."""
        own = [other for other, (at, _) in self._since.items() if at == address]
        yields = own[0] if len(own) >= WAITING_MAX else None
        if yields is None and len(self._since) >= WAITING_ALL_MAX:
            yields = next(iter(self._since))
        if yields is not None:
            del self._since[yields]
        self._since[number] = address, now
        return yields

    def remove(self, number: int) -> None:
        self._since.pop(number, None)

    def overdue(self, now: float) -> list[int]:
        """Return the connections that have been silent for longer than HELLO_S."""
        return [number for number, (_, since) in self._since.items() if now - since > HELLO_S]


class TlsDoor:
    """Listener at a public address that relays to `inner`, in threads of its own until `close`."""

    def __init__(self, host: str, port: int, inner: tuple[str, int]) -> None:
        """Listen and start. Raises OSError if the address is taken."""
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._socket = socket.create_server((host, port), family=family, backlog=1024)
        self._socket.setblocking(False)
        self._inner = inner
        self._failures = Failures()
        self._failed: deque[str] = deque()
        """Addresses whose connections failed, as their relays found."""
        self._waiting = Waiting()
        self._silent: dict[int, tuple[socket.socket, str]] = {}
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
            for key, _ in self._selector.select(STEP_S):
                if key.fileobj is self._socket:
                    self._accept(clock.now())
                else:
                    self._hear(key.fd, clock.now())
            while self._failed:
                self._failures.add(self._failed.popleft(), clock.now())
            for number in self._waiting.overdue(clock.now()):
                self._drop(number)

    def _accept(self, now: float) -> None:
        try:
            visitor, where = self._socket.accept()
        except OSError:  # gone again, or no file is left: the oldest silent one gives way at its time
            return
        address = where[0]
        if self._failures.refuses(address, now):
            visitor.close()
            return
        yields = self._waiting.add(visitor.fileno(), address, now)
        if yields is not None:
            self._drop(yields)
        self._silent[visitor.fileno()] = visitor, address
        self._selector.register(visitor, selectors.EVENT_READ)

    def _hear(self, number: int, now: float) -> None:
        """Let a connection in whose first byte begins a handshake; drop another."""
        visitor, address = self._silent[number]
        try:
            begins = visitor.recv(1, socket.MSG_PEEK)
        except OSError:
            begins = b""
        if begins != bytes([HANDSHAKE_RECORD]):
            self._drop(number)
            return
        self._forget(number)
        threading.Thread(target=self._relay, args=(visitor, address, now), daemon=True).start()

    def _forget(self, number: int) -> None:
        visitor, _ = self._silent.pop(number)
        self._waiting.remove(number)
        self._selector.unregister(visitor)

    def _drop(self, number: int) -> None:
        visitor, _ = self._silent[number]
        self._forget(number)
        with suppress(OSError):  # unread bytes would make the kernel reset the connection, without the end of stream
            visitor.recv(RELAY_BYTES, socket.MSG_DONTWAIT)
        visitor.close()

    def _relay(self, visitor: socket.socket, address: str, since: float) -> None:
        """Pass bytes both ways until either end closes."""
        with suppress(OSError), visitor, socket.create_connection(self._inner, HELLO_S) as inside:
            for end in (visitor, inside):
                end.settimeout(None)
                end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            back = threading.Thread(target=_pump, args=(inside, visitor), daemon=True)
            back.start()
            _pump(visitor, inside)
            back.join()
        if clock.now() - since < FAILED_S:
            self._failed.append(address)


def _pump(source: socket.socket, sink: socket.socket) -> None:
    """Pass bytes one way; at the end close both ways, as the end of a link's process must be seen at once."""
    with suppress(OSError):
        while data := source.recv(RELAY_BYTES):
            sink.sendall(data)
    for end in (source, sink):
        with suppress(OSError):
            end.shutdown(socket.SHUT_RDWR)
