"""State of one machine of a fleet, and the check that a start there would succeed."""

from __future__ import annotations

import contextlib
import os
import shutil
import socket
import stat
from importlib.metadata import version
from pathlib import Path

import msgspec
from msgspec import Struct

from lfa.deploy.fleet.host.ledger import GUARDIAN, Ledger, ledger, living, watchers
from lfa.deploy.fleet.host.units_host import check_units
from lfa.deploy.fleet.plan import host_plan
from lfa.deploy.fleet.plan.host_plan import HostPlan
from lfa.deploy.process.identity import identify
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.topics import HOST_PREFIX
from lfa.protocol.transport.credentials import OTHERS_WRITE, check_valid
from lfa.protocol.transport.zenoh_config import answers, socket_path
from lfa.protocol.transport.zenoh_router import UNIX_PATH_BYTES_MAX

POLL_S = 0.02
BACK_S = 4.0
"""Longest time [s] until a supervisor that its guardian starts again runs."""
FREE_MIB_MIN = 64


class Found(Struct, frozen=True):
    """State of a machine with respect to a fleet."""

    version: str
    wall_ms: int
    run: str = ""
    """Run of the supervisor that is running; empty: none."""
    digest: str = ""
    orphans: tuple[str, ...] = ()
    note: str = ""
    """What the user should know about a start; empty: nothing."""
    router: bool = False
    """True: the router answers."""
    certificate: str = ""
    """Fault of a certificate; empty: none."""


def check(part: HostPlan) -> Found:
    """Check that `start` would succeed: version, socket, folder, port, packages. Raises Refused; has no side effect."""
    if part.version != version("lfa"):
        raise Refused(f"has lfa {version('lfa')}: must be {part.version}, as on the operator's (lfa up --install)")
    running = _await_supervisor(part)
    found = Found(version("lfa"), clock.wall_ms())
    if running is not None:
        return _running(found, running, host_plan.read(part.folder / host_plan.PART))
    path = socket_path(part.socket)
    if path is None or len(os.fsencode(path)) > UNIX_PATH_BYTES_MAX:
        raise Refused(f"state = {part.state}: too long for a socket in it: at most {UNIX_PATH_BYTES_MAX} bytes")
    if path.exists() and answers(part.socket) and not _left(part):
        raise Refused(f"{path}: a router that this fleet did not start answers there: end it, or give another state")
    check_place(part)
    if part.engine != "own":
        check_units(part)
    if part.port:
        _check_port(part)
    if part.world:
        _check_world()
    return found


def _await_supervisor(part: HostPlan) -> Ledger | None:
    """Return the ledger of the running supervisor; one whose guardian runs is about to be started again."""
    until = clock.now() + BACK_S
    while (running := living(part.folder)) is None and clock.now() < until and any(watchers(part.folder, GUARDIAN)):
        clock.sleep(POLL_S)
    return running


def _left(part: HostPlan) -> bool:
    """Return True if an earlier supervisor's processes run on; `start` ends them."""
    written = ledger(part.folder)
    return written is not None and any(identify(child.pid) == child for child in written.children)


def _running(found: Found, running: Ledger, own: HostPlan) -> Found:
    """Return the state of the running router, and of the certificates that it and its clients show."""
    expired, known = "", None
    with contextlib.suppress(Refused):
        known = own.known_as(f"{HOST_PREFIX}{own.host}")
    try:
        for path in sorted((own.folder / host_plan.KEYS).glob("*.pem")) if own.keyed else ():
            check_valid(path, found.wall_ms)
    except Refused as refused:
        expired = str(refused)
    there = answers(own.socket, known)
    return msgspec.structs.replace(found, run=running.run, digest=running.digest, router=there, certificate=expired)


def check_place(part: HostPlan) -> None:
    """Raise Refused unless the nearest existing folder is writable, has FREE_MIB_MIN free, and is nobody else's."""
    place = part.folder
    while not place.exists():
        place = place.parent
    found = place.lstat()
    if place == part.folder and (found.st_uid != os.geteuid() or found.st_mode & OTHERS_WRITE):
        right = "must be your own folder that nobody else can write to, or a new one"
        raise Refused(f"state = {part.state}: of user {found.st_uid}, mode {found.st_mode & 0o7777:04o}: {right}")
    _check_above(part, place)
    if not place.is_dir() or not os.access(place, os.W_OK | os.X_OK):
        raise Refused(f"state = {part.state}: {place} cannot be written to")
    free_mib = shutil.disk_usage(place).free >> 20
    if free_mib < FREE_MIB_MIN:
        raise Refused(f"state = {part.state}: {free_mib} MiB are free there: must be at least {FREE_MIB_MIN}")


def _check_above(part: HostPlan, place: Path) -> None:
    """Raise Refused if another user could put a folder of theirs in the place of one on the way to `place`."""
    for above in place.resolve().parents if place == part.folder else (place.resolve(), *place.resolve().parents):
        found = above.stat()
        free = found.st_mode & stat.S_IWOTH and not found.st_mode & stat.S_ISVTX
        if free or found.st_uid not in (os.geteuid(), 0):
            is_ = f"{above} is of user {found.st_uid}, mode {stat.S_IMODE(found.st_mode):04o}"
            raise Refused(f"state = {part.state}: {is_}: must be in a folder in which nobody else can rename it")


def _check_port(part: HostPlan) -> None:
    """Raise Refused unless the port is free: in TCP, and if routers link over UDP also in UDP."""
    kinds = {"tcp": socket.SOCK_STREAM, **({"udp": socket.SOCK_DGRAM} if part.over_udp else {})}
    for name, kind in kinds.items():
        with socket.socket(family(part), kind) as probe:
            if kind is socket.SOCK_STREAM:
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(("", part.port))
            except OSError as error:
                right = f"must be a free port ({name})"
                raise Refused(f"router_port = {part.port}: {error.strerror}: {right}") from None


def family(part: HostPlan) -> socket.AddressFamily:
    """Return the address family that this machine's router listens in."""
    return socket.AF_INET6 if any("[" in endpoint for endpoint in part.listen) else socket.AF_INET


def _check_world() -> None:
    try:
        import lfa.world.world  # noqa: F401 (numpy and pymunk come with it)
    except ImportError as error:
        raise Refused(f"the world needs what is not installed ({error.name}): pip install 'lfa[world]'") from None
