"""Zenoh session configuration: endpoints, link leases, queues, certificates."""

from __future__ import annotations

import os
import stat
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec
import zenoh

from lfa.protocol.errors import Refused
from lfa.protocol.mission import Profile
from lfa.protocol.transport.credentials import FOREIGN_BITS, Credentials

LINK_LEASES_MS: dict[Profile, int] = {"fast": 500, "std": 1000, "wifi": 2000, "auto": 2000}
"""Silence [ms] after which a link counts as dead; radio has gaps of 0.7 s at 30 % loss (zenoh.md section 2)."""
LINK_LEASE_MS = LINK_LEASES_MS["std"]
QUEUE_BATCHES = dict.fromkeys(("real_time", "interactive_high", "data", "background"), 16)
"""Queue size [batches] per priority, Zenoh's maximum. With Zenoh's 2 for express messages, a link that a busy machine
does not serve for a few milliseconds drops lease messages and commands: 70 to 370 of 7000 messages in 7 s at a load of
8 on 2 cores; with 16 none."""
FOLLOWED_AT_ONCE = ("cmd_vel",)
"""Topics not sent express: the pose published next in each control step is sent in the same write."""
CLIENT_THREADS = 6
"""Number of threads of the one pool that reads, writes and keeps time. A client has one link at a time, and those that
it lost within the last 10 s. In one pool, the thread that waited for the socket also reads it: a quarter fewer wake-ups
than with one pool per task."""
SECURE_PROTOCOLS = ("unixsock-stream", "tls", "quic")


def default_endpoint() -> str:
    """Return the default endpoint, at which `lfa-router` listens and all other processes connect."""
    base = Path(os.environ.get("XDG_RUNTIME_DIR") or f"/tmp/lfa-{os.getuid()}")
    return f"unixsock-stream/{base / 'lfa-router.sock'}"


def check_default(endpoint: str) -> None:
    """Raise Refused if the default socket's folder is another user's, or if other users could put a socket there.

    A router of another user in a shared temporary folder would take over every process that connects without
    `--connect`. Folders of endpoints that the user names are the user's business.
    """
    usual = default_endpoint()
    path = socket_path(usual)
    if path is None or usual not in endpoint.split(","):
        return
    try:
        with suppress(FileExistsError):  # made here, before another user makes it while this process waits for a router
            path.parent.mkdir(mode=0o700)
        found = path.parent.lstat()
    except OSError:  # there is no place for one
        return
    mode = stat.S_IMODE(found.st_mode)
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.geteuid() or mode & FOREIGN_BITS:
        what = "a link" if stat.S_ISLNK(found.st_mode) else f"of user {found.st_uid}, mode {mode:04o}"
        raise Refused(f"{path.parent}: is {what}: must be your own folder with mode 0700, or give another endpoint")


def socket_path(endpoint: str) -> Path | None:
    """Return the path of a unix-socket endpoint, None for other transports."""
    kind, _, rest = endpoint.partition("/")
    return Path(rest) if kind == "unixsock-stream" else None


class RouterAbsent(ConnectionError):
    """No router answers at the endpoint."""


def answers(endpoint: str, credentials: Credentials | None = None) -> bool:
    """Return True if a session can be opened at `endpoint` at the moment."""
    try:
        client_session(endpoint, LINK_LEASE_MS, credentials).close()  # type: ignore[no-untyped-call]
    except zenoh.ZError:
        return False
    return True


def client_session(endpoint: str, lease_ms: int, credentials: Credentials | None) -> zenoh.Session:
    """Open a client session. Raises ZError, and Refused for the default endpoint in a folder of another user."""
    check_default(endpoint)
    config = session_config("client", [], endpoint.split(","), lease_ms, credentials)
    login = {} if credentials is None else login_settings(credentials)
    if not login:
        return open_session(config, CLIENT_THREADS)
    insert_settings(config, login)
    try:
        return open_session(config, CLIENT_THREADS)
    except zenoh.ZError:  # a router without passwords rejects a session that shows one
        return open_session(session_config("client", [], endpoint.split(","), lease_ms, credentials), CLIENT_THREADS)


def open_session(config: zenoh.Config, threads: int) -> zenoh.Session:
    """Open a session with one pool of `threads` threads, unless the environment sets ZENOH_RUNTIME.

    Zenoh reads ZENOH_RUNTIME at its first use in the process only; a child must not inherit it, as it may be a router.
    """
    if "ZENOH_RUNTIME" in os.environ:
        return zenoh.open(config)
    others = ", ".join(f"{pool}: (handover: rx)" for pool in ("app", "acc", "net", "tx"))
    os.environ["ZENOH_RUNTIME"] = f"(rx: (worker_threads: {threads}), {others})"
    try:
        return zenoh.open(config)
    finally:
        del os.environ["ZENOH_RUNTIME"]


def session_config(
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
    insert_settings(config, settings)
    return config


def insert_settings(config: zenoh.Config, settings: dict[str, Any]) -> None:
    for name, value in settings.items():
        config.insert_json5(name, msgspec.json.encode(value).decode())


def _certified(credentials: Credentials, *, serves: bool) -> dict[str, Any]:
    """Return the settings with which a session proves its identity and verifies routers over tls and quic.

    See zenoh.md section 5.
    """
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


def login_settings(credentials: Credentials) -> dict[str, Any]:
    """Return the settings of name and password, which secure routers require on all links.

    A router with a password requires one from every client.
    """
    known = credentials.user_and_password()
    return {} if known is None else {"transport/auth/usrpwd": {"user": known[0], "password": known[1]}}


def reason_of(error: zenoh.ZError) -> str:
    """Return the last cause of Zenoh's nested error text, on one line."""
    text = " ".join(str(error).split())
    return text.split(" at ")[0] if len(text) > 200 else text
