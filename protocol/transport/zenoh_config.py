"""Zenoh session configuration: endpoints, link leases, queues, certificates."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
import zenoh

from lfa.protocol.mission import Profile
from lfa.protocol.transport.credentials import Credentials

LINK_LEASES_MS: dict[Profile, int] = {"fast": 500, "std": 1000, "wifi": 2000}
"""Silence after which a link counts as dead; over radio there are gaps of 0.7 s at 30 % loss (zenoh.md section 2)."""


LINK_LEASE_MS = LINK_LEASES_MS["std"]


QUEUE_BATCHES = dict.fromkeys(("real_time", "interactive_high", "data", "background"), 16)
"""Zenoh's largest. With its 2 for what is express, a link that a busy machine leaves alone for a few milliseconds
drops leases and commands: 70 to 370 of 7000 messages in 7 s at a load of 8 on 2 cores; with 16 none."""


FOLLOWED_AT_ONCE = ("cmd_vel",)
"""Not sent by themselves: the pose that each control step says next takes them along, one write for the two."""


CLIENT_THREADS = 6
"""They read, write and keep the time in turn. A client has one link at a time, and those that it lost within the last
10 s. In one pool, what the socket brings is read by the thread that waited for it: a quarter fewer wake-ups than with
a pool for each."""


SECURE_PROTOCOLS = ("unixsock-stream", "tls", "quic")


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


def answers(endpoint: str, credentials: Credentials | None = None) -> bool:
    """True when a session can be opened at `endpoint` at the moment."""
    try:
        client_session(endpoint, LINK_LEASE_MS, credentials).close()  # type: ignore[no-untyped-call]
    except zenoh.ZError:
        return False
    return True


def client_session(endpoint: str, lease_ms: int, credentials: Credentials | None) -> zenoh.Session:
    config = session_config("client", [], endpoint.split(","), lease_ms, credentials)
    login = {} if credentials is None else login_settings(credentials)
    if not login:
        return _open(config, CLIENT_THREADS)
    insert_settings(config, login)
    try:
        return _open(config, CLIENT_THREADS)
    except zenoh.ZError:  # a router that asks for no password does not take one either
        return _open(session_config("client", [], endpoint.split(","), lease_ms, credentials), CLIENT_THREADS)


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


def login_settings(credentials: Credentials) -> dict[str, Any]:
    """Name and password, which secure routers ask for on all links; a router with one asks everybody for theirs."""
    known = credentials.user_and_password()
    return {} if known is None else {"transport/auth/usrpwd": {"user": known[0], "password": known[1]}}


def reason_of(error: zenoh.ZError) -> str:
    """The last cause of Zenoh's nested error text, on one line."""
    text = " ".join(str(error).split())
    return text.split(" at ")[0] if len(text) > 200 else text
