"""Zenoh behind the three methods of `Bus`, and the router: the only import of `zenoh` (zenoh.md section 0).

Every process is a client of its machine's router, over a unix socket or loopback; no multicast, no gossip. Callbacks
run on Zenoh's receiver threads and do nothing but append to the inbox.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from threading import get_ident
from typing import Any

import msgspec
import zenoh

from protocol import clock
from protocol.bus import Arrival, Inbox
from protocol.credentials import ACCESS_FILE, USERS_FILE, Credentials, check_private
from protocol.endpoints import check_endpoints
from protocol.mission import Profile, Refused, whole_number
from protocol.node import PeerDown, PeerUp, RouterLost
from protocol.topics import NO_ECHO, TOPIC, Topic, address, alive_key

LINK_LEASES_MS: dict[Profile, int] = {"fast": 500, "std": 1000, "wifi": 2000}
"""Silence after which a link counts as dead; over radio there are gaps of 0.7 s at 30 % loss (zenoh.md section 2)."""
LINK_LEASE_MS = LINK_LEASES_MS["std"]
QUEUE_BATCHES = dict.fromkeys(("real_time", "interactive_high", "data", "background"), 16)
"""Zenoh's largest. With its 2 for what is express, a link that a busy machine leaves alone for a few milliseconds
drops leases and commands: 70 to 370 of 7000 messages in 7 s at a load of 8 on 2 cores; with 16 none."""
FOLLOWED_AT_ONCE = ("cmd_vel",)
"""Not sent by themselves: the pose that each control step says next takes them along, one write for the two."""
ROUTER_RX_THREADS = 32  # more than the tcp links that can die at once: each blocks one for 10 s (zenoh.md section 2)
CLIENT_THREADS = 6
"""They read, write and keep the time in turn. A client has one link at a time, and those that it lost within the last
10 s. In one pool, what the socket brings is read by the thread that waited for it: a quarter fewer wake-ups than with
a pool for each."""
UNIX_PATH_BYTES_MAX = 107
SECURE_PROTOCOLS = ("unixsock-stream", "tls", "quic")

_PRIORITY = {
    "real_time": zenoh.Priority.REAL_TIME,
    "prompt": zenoh.Priority.INTERACTIVE_HIGH,
    "data": zenoh.Priority.DATA,
    "background": zenoh.Priority.BACKGROUND,
}


def default_endpoint() -> str:
    """Where `lfa-router` listens and everybody else connects when nothing is said."""
    base = Path(os.environ.get("XDG_RUNTIME_DIR") or f"/tmp/lfa-{os.getuid()}")
    return f"unixsock-stream/{base / 'lfa-router.sock'}"


def socket_path(endpoint: str) -> Path | None:
    """The file behind a unix-socket endpoint, None for other transports."""
    kind, _, rest = endpoint.partition("/")
    return Path(rest) if kind == "unixsock-stream" else None


class RouterAbsent(ConnectionError):
    """Nobody answers at the endpoint."""


class ZenohBus:
    """A client session with declared publishers, followed subscriptions and one liveliness token."""

    def __init__(
        self, endpoint: str, inbox: Inbox, lease_ms: int = LINK_LEASE_MS, credentials: Credentials | None = None
    ) -> None:
        """`endpoint` may be several, `a,b`: the first that answers, the next when that one is lost.

        `credentials` are shown to routers that ask for some, and tell whose routers are trusted. Raises RouterAbsent
        when no router answers or none lets us in, Refused for an endpoint that is none.
        """
        check_endpoints(endpoint, "connect")
        self._inbox = inbox
        try:
            self._session = _client(endpoint, lease_ms, credentials)
        except zenoh.ZError as error:
            raise RouterAbsent(_reason(error)) from None
        self._publishers: dict[str, zenoh.Publisher] = {}
        self._followed: dict[str, Any] = {}
        self._token: zenoh.LivelinessToken | None = None
        self._links = self._session.info.declare_transport_events_listener(
            zenoh.handlers.Callback(self._on_transport, indirect=False), history=False
        )

    def announce(self, fleet: str, owner: str, incarnation: int) -> None:
        """Declare the liveliness token that tells the others of this process's life."""
        self._token = self._session.liveliness().declare_token(alive_key(fleet, owner, incarnation))

    def living(self, fleet: str, owner: str, timeout_s: float = 1.0) -> list[int]:
        """Incarnations of `owner` whose tokens stand at the moment."""
        replies = self._session.liveliness().get(alive_key(fleet, owner, "*"), timeout=timeout_s)
        keys = [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]
        return sorted(peer.incarnation for key in keys if (peer := _peer(key, PeerUp)) is not None)

    def publish(self, key: str, payload: bytes) -> None:
        publisher = self._publishers.get(key)
        if publisher is None:
            publisher = self._publishers[key] = self._declare(key)
        publisher.put(payload)

    def follow(self, interests: frozenset[str]) -> None:
        for key in sorted(self._followed.keys() - interests):
            self._followed.pop(key).undeclare()
        for key in sorted(interests - self._followed.keys()):
            self._followed[key] = self._subscribe(key)

    def follow_anew(self) -> None:
        """Say once more to the router what is followed: declarations that cross a link while it comes back are
        dropped for good by a router that is busy (zenoh#1886), and all that they ask for with them."""
        for key in sorted(self._followed):
            self._followed[key].undeclare()
            self._followed[key] = self._subscribe(key)

    def close(self) -> None:
        """Undeclare all and leave: without it a callback subscriber would keep the interpreter alive."""
        self._session.close()  # type: ignore[no-untyped-call]

    def _declare(self, key: str) -> zenoh.Publisher:
        where = address(key)
        topic: Topic = TOPIC[where.topic] if where is not None else TOPIC["event"]
        return self._session.declare_publisher(
            key,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=_PRIORITY[topic.priority],
            express=topic.priority == "real_time" and topic.name not in FOLLOWED_AT_ONCE,
            allowed_destination=zenoh.Locality.REMOTE if topic.name in NO_ECHO else zenoh.Locality.ANY,
        )

    def _subscribe(self, key: str) -> Any:
        parts = key.split("/")
        if len(parts) == 5 and parts[3] == "alive":
            callback = zenoh.handlers.Callback(self._on_token, indirect=False)
            return self._session.liveliness().declare_subscriber(key, callback, history=True)
        return self._session.declare_subscriber(key, zenoh.handlers.Callback(self._on_sample(key), indirect=False))

    def _on_sample(self, expression: str) -> Callable[[zenoh.Sample], None]:
        """What to do with a sample on `expression`, which is its key when it is no pattern."""
        put = self._inbox.put
        known = None if "*" in expression else expression

        def on_sample(sample: zenoh.Sample) -> None:
            if get_ident() not in _attached:
                _attach()
            put(Arrival(clock.now(), known or str(sample.key_expr), sample.payload.to_bytes()))

        return on_sample

    def _on_token(self, sample: zenoh.Sample) -> None:
        key = str(sample.key_expr)
        peer = _peer(key, PeerUp if sample.kind == zenoh.SampleKind.PUT else PeerDown)
        if peer is not None:
            self._inbox.put(Arrival(clock.now(), key, peer))

    def _on_transport(self, event: Any) -> None:
        if event.kind == zenoh.SampleKind.DELETE:
            self._inbox.put(Arrival(clock.now(), "", RouterLost()))


_attached: set[int] = set()


def _attach() -> None:
    """Let Python keep what it knows of the calling receiver thread, which lives as long as the process.

    Otherwise it makes that anew for each sample, with memory for its stack that the kernel maps and takes back: a
    fifteenth of an agent's processor time.
    """
    _attached.add(get_ident())
    ctypes.pythonapi.PyGILState_Ensure()


def open_router(
    listen: Sequence[str],
    connect: Sequence[str] = (),
    lease_ms: int = LINK_LEASE_MS,
    credentials: Credentials | None = None,
    secure: bool = False,
) -> Callable[[], None]:
    """Start a router in this process; the returned function closes it.

    `credentials` serve its `tls/` and `quic/` links, both ends of which prove who they are. `secure`: whoever it is,
    only what the rules in their folder let it say and hear passes, and a unix socket asks for name and password.
    Raises Refused when an endpoint cannot be listened on: taken, not permitted, not secure, or too long a path.
    """
    os.environ.setdefault("ZENOH_RUNTIME", f"(rx: (worker_threads: {ROUTER_RX_THREADS}))")
    for endpoint in listen:
        check_endpoints(endpoint, "listen")
        _check_listen(endpoint, credentials, secure)
    for endpoint in connect:
        check_endpoints(endpoint, "connect")
    config = _config("router", listen, connect, lease_ms, credentials)
    if secure:
        assert credentials is not None
        _insert(config, _guard(credentials))
    mask = os.umask(0o077)  # for the unix socket: 0600
    try:
        session = zenoh.open(config)
    except zenoh.ZError as error:
        raise Refused(f"listen {' '.join(listen)}: {_reason(error)}") from None
    finally:
        os.umask(mask)

    def close() -> None:
        session.close()  # type: ignore[no-untyped-call]
        for endpoint in listen:
            path = socket_path(endpoint)
            if path is not None:
                path.unlink(missing_ok=True)
                Path(f"{path}.lock").unlink(missing_ok=True)

    return close


def answers(endpoint: str, credentials: Credentials | None = None) -> bool:
    """True when a session can be opened at `endpoint` at the moment."""
    try:
        _client(endpoint, LINK_LEASE_MS, credentials).close()  # type: ignore[no-untyped-call]
    except zenoh.ZError:
        return False
    return True


def _client(endpoint: str, lease_ms: int, credentials: Credentials | None) -> zenoh.Session:
    config = _config("client", [], endpoint.split(","), lease_ms, credentials)
    login = {} if credentials is None else _login(credentials)
    if not login:
        return _open(config, CLIENT_THREADS)
    _insert(config, login)
    try:
        return _open(config, CLIENT_THREADS)
    except zenoh.ZError:  # a router that asks for no password does not take one either
        return _open(_config("client", [], endpoint.split(","), lease_ms, credentials), CLIENT_THREADS)


def _open(config: zenoh.Config, threads: int) -> zenoh.Session:
    """With so many threads for all, unless the environment says otherwise or this process has some already.

    Zenoh reads it from the environment, at the first use; a child must not inherit it: it may be a router.
    """
    if "ZENOH_RUNTIME" in os.environ:
        return zenoh.open(config)
    others = ", ".join(f"{pool}: (handover: rx)" for pool in ("app", "acc", "net", "tx"))
    os.environ["ZENOH_RUNTIME"] = f"(rx: (worker_threads: {threads}), {others})"
    try:
        return zenoh.open(config)
    finally:
        del os.environ["ZENOH_RUNTIME"]


def _check_listen(endpoint: str, credentials: Credentials | None, secure: bool) -> None:
    protocol = endpoint.partition("/")[0]
    if secure and protocol not in SECURE_PROTOCOLS:
        raise Refused(f"listen {endpoint}: not with --secure, must begin with {', '.join(SECURE_PROTOCOLS)}")
    if credentials is None and protocol in ("tls", "quic"):
        raise Refused(f"listen {endpoint}: needs a certificate, give --keys")
    path = socket_path(endpoint)
    if path is None:
        return
    if len(os.fsencode(path)) > UNIX_PATH_BYTES_MAX:
        raise Refused(f"listen {endpoint}: the path has more than {UNIX_PATH_BYTES_MAX} bytes, give a shorter one")
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    except OSError as error:
        raise Refused(f"listen {endpoint}: {error.strerror}") from None
    if path.exists() and answers(endpoint):
        raise Refused(f"listen {endpoint}: another router answers there, stop it or give another --listen")


def _config(
    mode: str, listen: Sequence[str], connect: Sequence[str], lease_ms: int, credentials: Credentials | None
) -> zenoh.Config:
    settings: dict[str, object] = {
        "mode": mode,
        "listen/endpoints": list(listen),
        "connect/endpoints": list(connect),
        "connect/retry": {"period_init_ms": 200, "period_max_ms": 1000, "period_increase_factor": 1.5},
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 0,
        "transport/link/tx/lease": lease_ms,
        "transport/link/tx/queue/size": QUEUE_BATCHES,
        "transport/shared_memory/enabled": False,
    }
    if credentials is not None:
        settings |= _certified(credentials, serves=mode == "router")
    config = zenoh.Config()
    _insert(config, settings)
    return config


def _insert(config: zenoh.Config, settings: dict[str, Any]) -> None:
    for name, value in settings.items():
        config.insert_json5(name, msgspec.json.encode(value).decode())


def _certified(credentials: Credentials, *, serves: bool) -> dict[str, Any]:
    """How a session shows who it is over tls and quic, and whom it takes for a router (zenoh.md section 5)."""
    certificate, key = str(credentials.certificate), str(credentials.key)
    tls: dict[str, object] = {
        "root_ca_certificate": str(credentials.ca),
        "enable_mtls": True,
        "connect_certificate": certificate,
        "connect_private_key": key,
        "close_link_on_expiration": True,
    }
    if serves:
        tls |= {"listen_certificate": certificate, "listen_private_key": key}
    return {"transport/link/tls": tls}


def _login(credentials: Credentials) -> dict[str, Any]:
    """Name and password, which secure routers ask for on all links; a router with one asks everybody for theirs."""
    known = credentials.user_and_password()
    return {} if known is None else {"transport/auth/usrpwd": {"user": known[0], "password": known[1]}}


def _guard(credentials: Credentials) -> dict[str, Any]:
    """What a secure router adds: passwords, and the rules of who may say and hear what. Raises Refused."""
    folder = credentials.certificate.parent
    users, access = folder / USERS_FILE, folder / ACCESS_FILE
    check_private(users)
    try:
        rules = msgspec.json.decode(access.read_bytes(), type=dict[str, Any])
    except (OSError, msgspec.DecodeError) as error:
        raise Refused(f"{access}: {error}, must be the rules that `lfa keys` wrote") from None
    users_file = {"transport/auth/usrpwd/dictionary_file": str(users)}
    return _login(credentials) | users_file | {"transport/link/protocols": SECURE_PROTOCOLS} | rules


def _reason(error: zenoh.ZError) -> str:
    """The last cause of Zenoh's nested error text, on one line."""
    text = " ".join(str(error).split())
    return text.split(" at ")[0] if len(text) > 200 else text


def _peer(key: str, kind: type[PeerUp] | type[PeerDown]) -> PeerUp | PeerDown | None:
    where = address(key)
    if where is None or where.topic != "alive" or where.to is None:
        return None
    incarnation = whole_number(where.to)
    return None if incarnation is None else kind(where.owner, incarnation)
