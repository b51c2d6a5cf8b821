"""Zenoh router session that listens on given endpoints."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import zenoh

from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import DamagedFile, read_json
from lfa.protocol.transport.credentials import ACCESS_FILE, USERS_FILE, Credentials, check_own, check_private
from lfa.protocol.transport.endpoints import check_endpoints
from lfa.protocol.transport.tls_door import FAILED_S, LISTENERS, TlsDoor
from lfa.protocol.transport.zenoh_config import (
    LINK_LEASE_MS,
    SECURE_PROTOCOLS,
    answers,
    check_default,
    insert_settings,
    login_settings,
    reason_of,
    session_config,
    socket_path,
)

ROUTER_RX_THREADS = (
    32  # more than the tcp links that can fail at once: each blocks one thread for 10 s (zenoh.md section 2)
)
UNIX_PATH_BYTES_MAX = 107
HANDSHAKE_LIMIT = f"tls_handshake_timeout_ms={round(1000.0 * FAILED_S)}"


def open_router(
    listen: Sequence[str],
    connect: Sequence[str] = (),
    lease_ms: int = LINK_LEASE_MS,
    credentials: Credentials | None = None,
    secure: bool = False,
) -> Callable[[], None]:
    """Start a router in this process; return the function that closes it.

    `credentials` serve its `tls/` and `quic/` links, both ends of which prove their identity. With `secure`, only
    messages that the rules in the credentials' folder permit pass, and a unix socket requires name and password.
    Raises Refused if it cannot listen at an endpoint: taken, not permitted, not secure, or the path is too long.
    """
    os.environ.setdefault("ZENOH_RUNTIME", f"(rx: (worker_threads: {ROUTER_RX_THREADS}))")
    for endpoint in listen:
        check_endpoints(endpoint, "listen")
        check_listen(endpoint, credentials, secure)
    for endpoint in connect:
        check_endpoints(endpoint, "connect")
    doors = {endpoint: _free_ports(LISTENERS) for endpoint in listen if endpoint.startswith("tls/")}
    behind = [endpoint for endpoint in listen if endpoint not in doors]
    behind += [f"tls/127.0.0.1:{port}#{HANDSHAKE_LIMIT}" for ports in doors.values() for port in ports]
    config = session_config("router", behind, connect, lease_ms, credentials)
    if secure:
        assert credentials is not None
        insert_settings(config, _guard(credentials))
    mask = os.umask(0o077)  # for the unix socket: 0600
    try:
        session = zenoh.open(config)
    except zenoh.ZError as error:
        raise Refused(f"listen {' '.join(listen)}: {reason_of(error)}") from None
    finally:
        os.umask(mask)
    opened: list[TlsDoor] = []
    try:
        for endpoint, ports in doors.items():
            host, _, public = endpoint.removeprefix("tls/").rpartition(":")
            opened.append(TlsDoor(host.strip("[]"), int(public), [("127.0.0.1", port) for port in ports]))
    except OSError as error:
        session.close()  # type: ignore[no-untyped-call]
        raise Refused(f"listen {' '.join(listen)}: {error.strerror}") from None

    def close() -> None:
        for door in opened:
            door.close()
        session.close()  # type: ignore[no-untyped-call]
        for endpoint in listen:
            path = socket_path(endpoint)
            if path is not None:
                path.unlink(missing_ok=True)
                Path(f"{path}.lock").unlink(missing_ok=True)

    return close


def _free_ports(count: int) -> list[int]:
    """Return free ports on loopback, for the listeners behind a door."""
    with ExitStack() as probes:
        found = [probes.enter_context(socket.socket()) for _ in range(count)]
        for probe in found:
            probe.bind(("127.0.0.1", 0))
        return [int(probe.getsockname()[1]) for probe in found]


def check_listen(endpoint: str, credentials: Credentials | None, secure: bool) -> None:
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
    check_default(endpoint)
    if path.exists() and answers(endpoint):
        raise Refused(f"listen {endpoint}: another router answers there, stop it or give another --listen")


def _guard(credentials: Credentials) -> dict[str, Any]:
    """Return the settings of a secure router: passwords and access rules. Raises Refused if a file is invalid."""
    folder = credentials.certificate.parent
    users, access = folder / USERS_FILE, folder / ACCESS_FILE
    check_private(users)
    check_own(access)
    try:
        rules = read_json(access, dict[str, Any])
    except (OSError, DamagedFile) as error:
        raise Refused(f"{access}: {error}, must be the rules that `lfa keys` wrote") from None
    users_file = {"transport/auth/usrpwd/dictionary_file": str(users)}
    return login_settings(credentials) | users_file | {"transport/link/protocols": SECURE_PROTOCOLS} | rules
