"""Who is not let in at the doors of a secured fleet, and that nobody else is kept out by it."""

from __future__ import annotations

import signal
import socket
import ssl
import stat
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path

import pytest

from lfa.deploy.fleet.security import authority
from tests.rigs.lfa_runs import eventually
from tests.rigs.secured_fleet import FLEET, REVOKED, TRAITOR, Attacked, forge, free_port, tls

pytestmark = pytest.mark.processes

SILENT_GAP_S, SILENT_S, SILENT_ADDRESSES = 0.05, 12.0, 97


def test_no_certificate(fleet: Attacked) -> None:
    nobody = {"transport/link/tls": {"root_ca_certificate": str(fleet.keys / "ca.pem")}}
    assert fleet.refused(fleet.tls, None, **nobody)
    assert not fleet.refused(fleet.tls), "nor is one with a certificate"


def test_a_certificate_of_another_authority(fleet: Attacked, tmp_path: Path) -> None:
    authority.found(tmp_path / "ca.pem", tmp_path / "ca.key", FLEET)
    assert fleet.refused(fleet.tls, TRAITOR, forge(fleet.folder / "foreign", TRAITOR, tmp_path))


def test_an_expired_certificate(fleet: Attacked) -> None:
    assert fleet.refused(fleet.tls, TRAITOR, forge(fleet.folder / "expired", TRAITOR, fleet.keys, days=-0.01))
    assert not fleet.refused(fleet.tls, TRAITOR, forge(fleet.folder / "fresh", TRAITOR, fleet.keys))


def test_a_certificate_that_expires_closes_its_link(fleet: Attacked) -> None:
    brief = forge(fleet.folder / "brief", TRAITOR, fleet.keys, days=2.5 / 86400.0)
    with fleet.open(fleet.tls, TRAITOR, brief) as session:
        assert session.info.links(), "it was let in while the certificate was valid"
        eventually(lambda: not session.info.links(), "the link outlives the certificate", 20.0)


def test_a_revoked_robots_old_keys(fleet: Attacked) -> None:
    assert fleet.refused(fleet.tls, REVOKED)
    assert fleet.refused(fleet.unix, REVOKED)


def test_no_password_on_the_unix_socket(fleet: Attacked) -> None:
    assert fleet.refused(fleet.unix, None)


def test_a_wrong_password_on_the_unix_socket(fleet: Attacked) -> None:
    guess = {"transport/auth/usrpwd": {"user": "robot1", "password": "guess"}}
    assert fleet.refused(fleet.unix, None, **guess)


def test_the_unix_socket_of_another_user(fleet: Attacked) -> None:
    path = Path(fleet.unix.removeprefix("unixsock-stream/"))
    assert stat.S_IMODE(path.stat().st_mode) & 0o077 == 0


def test_plain_tcp_to_the_tls_port(fleet: Attacked) -> None:
    assert fleet.refused(f"tcp/127.0.0.1:{fleet.port}")
    with socket.create_connection(("127.0.0.1", fleet.port), timeout=5.0) as raw:
        raw.sendall(b"\x00" * 4096)
        assert raw.recv(4096)[:1] in (b"", b"\x15"), "anything but a TLS alert"


def test_a_robots_certificate_in_the_routers_place(fleet: Attacked) -> None:
    """Robot 3's computer listens as a router: nobody's session takes its certificate for one."""
    endpoint, stolen = f"tls/127.0.0.1:{free_port()}", fleet.folder / "stolen"
    own = tls(fleet.keys / "ca.pem", stolen / TRAITOR)
    own |= {"listen_private_key": f"{stolen / TRAITOR}.key", "listen_certificate": f"{stolen / TRAITOR}.pem"}
    config = {"mode": "router", "connect/endpoints": [], "listen/endpoints": [endpoint], "transport/link/tls": own}
    with fleet.open("", TRAITOR, **config):
        assert fleet.refused(endpoint, "robot1")


@contextmanager
def silent_connections(fleet: Attacked) -> Iterator[None]:
    """Twenty a second from anyone, without any certificate: Zenoh alone lets nobody in any more after some seconds.

    In turn they say nothing, a part of a ClientHello, and a whole one, from other addresses than the fleet's.
    """
    silent: list[socket.socket] = []
    stop = threading.Event()
    hello = _client_hello()
    said = (b"", hello[:1], hello[:40], hello)

    def stand() -> None:
        for n in count():
            if stop.wait(SILENT_GAP_S):
                return
            with suppress(OSError):
                source = (f"127.0.1.{1 + n % SILENT_ADDRESSES}", 0)
                silent.append(socket.create_connection(("127.0.0.1", fleet.port), 5.0, source))
                silent[-1].sendall(said[n % len(said)])

    standing = threading.Thread(target=stand)
    standing.start()
    try:
        eventually(lambda: len(silent) > SILENT_S / SILENT_GAP_S, "nobody stands at the door", 4.0 * SILENT_S)
        yield
    finally:
        stop.set()
        standing.join()
        for one in silent:
            one.close()


def _client_hello() -> bytes:
    """What a client says first."""
    context = ssl.create_default_context()
    sent = ssl.MemoryBIO()
    with suppress(ssl.SSLWantReadError):
        context.wrap_bio(ssl.MemoryBIO(), sent, server_hostname="localhost").do_handshake()
    return sent.read()


def _to_the_tail(fleet: Attacked, robot: int) -> None:
    """Kill a robot and start it again: it joins at the tail."""
    fleet.team.signal(robot, signal.SIGKILL)
    fleet.team.wait_until(lambda: robot not in fleet.team.chain(), f"robot {robot} is not missed")
    fleet.team.restart(robot)
    fleet.team.wait_until(lambda: set(fleet.team.chain()) == {1, 2, 3}, f"robot {robot} does not come back", SILENT_S)


def test_silent_connections_lock_out_neither_a_new_member_nor_one_that_returns(fleet: Attacked) -> None:
    with silent_connections(fleet):
        assert not fleet.refused(fleet.tls)
        _to_the_tail(fleet, 2)  # the robot whose link goes through the door
    _to_the_tail(fleet, 3)  # so that the chain is in its order again for the other tests


def test_a_leader_that_dies_while_silent_connections_stand_at_the_door_is_followed_by_the_next(fleet: Attacked) -> None:
    """The next in the chain is the robot behind the door; the leader comes back at the tail."""
    with silent_connections(fleet):
        fleet.team.signal(1, signal.SIGKILL)
        fleet.team.wait_until(lambda: fleet.team.chain() == (2, 3), "robot 2 does not lead on", SILENT_S)
        fleet.team.restart(1)
        fleet.team.wait_until(lambda: fleet.team.chain() == (2, 3, 1), "robot 1 does not come back", SILENT_S)
    for robot in (2, 3):
        _to_the_tail(fleet, robot)
