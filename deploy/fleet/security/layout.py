"""Writing of a fleet's keys: certificates, passwords and requests of all members, and one folder per machine."""

from __future__ import annotations

import secrets
import shutil
from collections.abc import Sequence
from pathlib import Path

import msgspec
from msgspec import structs

from lfa.deploy.fleet.security import authority
from lfa.deploy.fleet.security.access_rules import KeyPlan, host_name, person_of, rules
from lfa.deploy.fleet.security.private_files import ISSUED, private_folder, write_private
from lfa.deploy.fleet.security.registry import CA_KEY, HOSTS, REGISTRY, REQUESTS, Registry, folder_of
from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import DamagedFile, read_text
from lfa.protocol.transport.credentials import ACCESS_FILE, CA_FILE, PASSWORD_BYTES_MAX, USERS_FILE

KINDS = ("pem", "key", "password")


class Unsigned(Refused):
    """Members of the keys in `folder` whose certificates an outside authority has yet to sign."""

    def __init__(self, folder: Path, names: Sequence[str]) -> None:
        where = f"have {folder / REQUESTS}/*.csr signed, put the certificates into {folder / ISSUED}/NAME.pem"
        super().__init__(f"{len(names)} certificates are not signed yet ({names[0]}, ...): {where}, and repeat")
        self.names = names


def lay_out(folder: Path, registry: Registry, days: float, renew: Sequence[str]) -> list[str]:
    """Issue missing certificates, then rewrite every machine's folder; return the members with a new certificate.

    Raises OSError, and Unsigned after writing the requests for an outside authority.
    """
    issued = folder / ISSUED
    for inner in (folder, issued, folder / HOSTS):
        private_folder(inner)
    write_private(issued / CA_FILE, (folder / CA_FILE).read_bytes())
    fresh = {name: name for name in registry.members() if name not in registry.revoked}
    registry = structs.replace(registry, common_names=fresh | registry.common_names).with_places()
    if registry.outside:
        _await_signatures(folder, registry, renew)
    ca = None if registry.outside else authority.load(folder / CA_FILE, folder / CA_KEY)
    made = []
    for name in registry.members():
        stem = issued / name
        common = registry.common_names.get(name)
        if common is None:
            _remove(stem)
            continue
        addresses = addresses_of(name, registry.plan)
        if ca is not None and (name in renew or not authority.fits(stem, ca.certificate, common, addresses)):
            authority.issue(stem, ca, common, addresses, days)
            made.append(name)
        _password(stem.with_name(f"{name}.password"), common)
    for name in registry.common_names.keys() - set(registry.members()):
        _remove(issued / name)
    for left in (folder / HOSTS).iterdir():
        if left.name not in registry.plan.hosts and left.is_dir() and not left.is_symlink():
            shutil.rmtree(left)
    for host in registry.plan.hosts:
        _lay_out_host(folder, registry, host)
    write_private(folder / REGISTRY, msgspec.json.format(msgspec.json.encode(registry), indent=1))
    return made


def _await_signatures(folder: Path, registry: Registry, renew: Sequence[str]) -> None:
    """Write the requests that are open, and the registry. Raises Unsigned while there are some."""
    write_private(folder / REGISTRY, msgspec.json.format(msgspec.json.encode(registry), indent=1))
    waiting = write_requests(folder, registry, renew)
    if waiting:
        raise Unsigned(folder, [path.stem for path in waiting])


def write_requests(folder: Path, registry: Registry, renew: Sequence[str]) -> list[Path]:
    """Write a request for each member without a fitting certificate, and for `renew`; return the requests' paths."""
    ca, waiting = authority.certificate_of(folder / CA_FILE), []
    private_folder(folder / REQUESTS)
    members = set(registry.members())
    for name, common in registry.common_names.items():
        stem, path = folder / ISSUED / name, folder / REQUESTS / f"{name}.csr"
        addresses = addresses_of(name, registry.plan)
        fits = name not in renew and authority.fits(stem, ca, common, addresses)
        if fits or name not in members:  # who has left the plan has no keys any more
            path.unlink(missing_ok=True)
            continue
        authority.request(stem, path, common, addresses)
        waiting.append(path)
    return waiting


def _lay_out_host(folder: Path, registry: Registry, host: str) -> None:
    plan, here = registry.plan, folder_of(folder, host)
    private_folder(here)
    kept = [name for name in plan.kept_at(host) if name in registry.common_names]
    files = {f"{person_of(name) or name}.{kind}": f"{name}.{kind}" for name in kept for kind in KINDS}
    wanted = {CA_FILE, ACCESS_FILE, USERS_FILE, *files}
    for path in here.iterdir():
        if path.name not in wanted:
            path.unlink()
    write_private(here / CA_FILE, (folder / CA_FILE).read_bytes())
    for file, source in files.items():
        write_private(here / file, (folder / ISSUED / source).read_bytes())
    joining = [name for name in (*plan.at(host), *map(host_name, plan.hosts)) if name in registry.common_names]
    write_private(here / USERS_FILE, b"".join((folder / ISSUED / f"{name}.password").read_bytes() for name in joining))
    _write_rules(here, registry, host)


def shut_out(folder: Path, registry: Registry) -> None:
    """Take the members without a common name off the lists of all machines, and their keys away. Raises OSError.

    All others stay as they are, so that this waits for no signature.
    """
    out = [name for name in registry.members() if name not in registry.common_names]
    admitted = {common.encode() for common in registry.common_names.values()}
    for name in out:
        _remove(folder / ISSUED / name)
    for host in registry.plan.hosts:
        here = folder_of(folder, host)
        if not (here / USERS_FILE).exists():  # nothing was laid out for it yet
            continue
        for path in (here / f"{person_of(name) or name}.{kind}" for name in out for kind in KINDS):
            path.unlink(missing_ok=True)
        users = (here / USERS_FILE).read_bytes().splitlines(keepends=True)
        write_private(here / USERS_FILE, b"".join(user for user in users if user.partition(b":")[0] in admitted))
        _write_rules(here, registry, host)


def _write_rules(here: Path, registry: Registry, host: str) -> None:
    text = msgspec.json.format(msgspec.json.encode(rules(registry.plan, host, registry.common_names)))
    write_private(here / ACCESS_FILE, text)


def addresses_of(name: str, plan: KeyPlan) -> tuple[str, ...]:
    """Return the addresses of a router, for its server certificate; empty for any other member."""
    for host, addresses in plan.hosts.items():
        if name == host_name(host):
            return tuple(dict.fromkeys((host, *addresses, "localhost", "127.0.0.1", "::1")))
    return ()


def _password(path: Path, common_name: str) -> None:
    try:
        fits = read_text(path, PASSWORD_BYTES_MAX).startswith(f"{common_name}:")
    except (OSError, DamagedFile):
        fits = False
    if not fits:
        write_private(path, f"{common_name}:{secrets.token_urlsafe(24)}\n".encode())


def _remove(stem: Path) -> None:
    for kind in KINDS:
        stem.with_name(f"{stem.name}.{kind}").unlink(missing_ok=True)
