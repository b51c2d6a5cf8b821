"""Certificates, passwords and rules of a fleet on disk: creation, renewal, revocation, and one folder per machine.

    DIR/ca.pem, ca.key       the fleet's authority; the key never leaves the operator's machine
    DIR/fleet.json           routers and common name of each member (no secrets)
    DIR/requests/            signing requests for an outside authority, if one signs (no ca.key then)
    DIR/issued/              certificate, key and password of every member: the operator's `--keys`, on no machine
    DIR/hosts/a/             all files that machine `a` needs, and no others: `scp -r DIR/hosts/a a:/etc/lfa/keys`
        ca.pem, host-a.*     for its router and supervisor (the only server certificates)
        robot1.pem .key .password   for its processes
        operator.*, recorder.*      for persons who work at this machine: members `operator-a`, `recorder-a`
        access.json, users   access rules and passwords of its router with `--secure`

Use, as in `lfa up`:

    plan = spread("fleet", hosts={"a": ("10.0.0.1",), "b": ("10.0.0.2",)}, robots=range(1, 13))
    make(folder, plan)                       # idempotent: issues only what is missing, expiring or misplaced
    folder_of(folder, "a")                   # to be copied to machine a, and given to its processes as --keys
    revoke(folder, ["robot3"]); rotate(folder, ["robot4"])

A process with `--keys /etc/lfa/keys` uses the certificate of its name (`protocol/transport/credentials.py`);
`lfa-router --keys DIR` listens at `tls/` and `quic/`, and enforces the rules with `--secure`. Files are 0600, folders
0700.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path

from msgspec import Struct, structs

from lfa.deploy.fleet.security import authority
from lfa.deploy.fleet.security.access_rules import PERSONS, KeyPlan, driver_of, host_name, sayable, stationed
from lfa.deploy.fleet.security.layout import Unsigned, addresses_of, lay_out, shut_out, write_requests
from lfa.deploy.fleet.security.private_files import ISSUED, private_folder, write_private
from lfa.deploy.fleet.security.registry import CA_KEY, REGISTRY, Registry, check_names, load
from lfa.deploy.whole_output import whole_folder
from lfa.protocol.errors import Refused
from lfa.protocol.names import WITNESS_NAME, robot_name
from lfa.protocol.topics import WORLD_NAME
from lfa.protocol.transport.credentials import CA_FILE, validity

DAYS = 365.0


class Shown(Struct, frozen=True):
    """One line of `lfa keys show`."""

    name: str
    state: str
    """`valid`, `expired` or `revoked`."""
    common_name: str
    until: str
    """End of validity, UTC."""
    joins_at: tuple[str, ...]
    says: tuple[str, ...]
    """Key expressions that it may publish on."""


def spread(
    fleet: str,
    hosts: Mapping[str, Sequence[str]],
    robots: Iterable[int],
    places: Mapping[str, Sequence[str]] | None = None,
    drivers: Iterable[int] = (),
) -> KeyPlan:
    """Return a plan that distributes robots in turn over the machines, each with the next machine's router as second.

    `places` overrides this for single members (`{"robot3": ["b"]}`); `drivers` are the robots whose hardware the world
    does not simulate. World and witness are on the first machine (`witness` in `places` is one with its own process);
    operator and recorder may join anywhere, as persons and as those stationed at each machine. Raises Refused.
    """
    names = list(hosts)
    if not names:
        raise Refused("hosts: must be at least one machine")
    drawn = {host_name(host): _turn(names, n) for n, host in enumerate(names)}
    drawn |= {robot_name(robot): _turn(names, n) for n, robot in enumerate(robots)}
    drawn[WORLD_NAME] = _turn(names, 0)
    drawn |= {driver_of(robot_name(robot)): drawn.get(robot_name(robot), ()) for robot in drivers}
    for person in PERSONS:
        drawn[person] = tuple(names)
        drawn |= {stationed(person, host): (host, *(name for name in names if name != host)) for host in names}
    for name, where in (places or {}).items():
        strange = [host for host in where if host not in names]
        if name not in (*drawn, WITNESS_NAME) or strange or not where:
            raise Refused(f"place {name}={'+'.join(where)}: must be a member, at machines among {', '.join(names)}")
        drawn[name] = tuple(where)
        if driver_of(name) in drawn and driver_of(name) not in (places or {}):
            drawn[driver_of(name)] = tuple(where)
    if homeless := [name for name, where in drawn.items() if not where]:
        raise Refused(f"drivers: {', '.join(homeless)} drives no robot of this fleet")
    return KeyPlan(fleet, {host: tuple(addresses) for host, addresses in hosts.items()}, drawn)


def _turn(names: list[str], n: int) -> tuple[str, ...]:
    return tuple(dict.fromkeys((names[n % len(names)], names[(n + 1) % len(names)])))


def make(folder: Path, plan: KeyPlan, days: float = DAYS, ca_cert: Path | None = None) -> list[str]:
    """Create all files of `plan` in `folder`; return the members with a new certificate. Raises Refused.

    A new folder appears whole, or not at all. With the certificate `ca_cert` of an outside authority, requests are
    written for it (`requested`), and nobody gets keys before all are signed.
    """
    outside = None if ca_cert is None else authority.certificate_of(ca_cert)
    authority.check_names(plan.fleet, {name: addresses_of(name, plan) for name in plan.places})
    known = load(folder) if (folder / REGISTRY).exists() else Registry(plan)
    if known.plan.fleet != plan.fleet:
        raise Refused(f"{folder}: holds the keys of fleet {known.plan.fleet!r}, give another folder")
    if outside is not None and (folder / CA_KEY).exists():
        raise Refused(f"{folder}: has an authority of its own, give another folder with --ca-cert")
    registry = structs.replace(known, plan=plan, outside=known.outside or outside is not None)
    unsigned: Sequence[str] = ()
    try:
        used = folder.exists() and any(folder.iterdir())
        with nullcontext(folder) if used else whole_folder(folder, 0o700) as place:
            private_folder(place)
            if ca_cert is not None:
                write_private(place / CA_FILE, ca_cert.read_bytes())
            elif not known.outside and not (place / CA_KEY).exists():
                authority.found(place / CA_FILE, place / CA_KEY, plan.fleet)
            try:
                made = lay_out(place, registry, days, renew=())
            except Unsigned as waiting:  # whose requests stay
                made, unsigned = [], waiting.names
        private_folder(folder)
    except OSError as error:
        raise _unwritable(folder, error) from None
    if unsigned:
        raise Unsigned(folder, unsigned)
    return made


def rotate(folder: Path, names: Sequence[str] = (), days: float = DAYS) -> list[str]:
    """Issue new keys and certificates to `names` (all when empty); a revoked member returns under a new common name.

    Old certificates stay valid until they expire, so that running processes continue; for stolen keys use `revoke`.
    Raises Refused.
    """
    registry = load(folder)
    if registry.outside:
        raise Refused(f"{folder}: an outside authority signs: lfa keys csr {folder} NAMES, and init once it has")
    chosen = list(names) or [name for name in registry.members() if name in registry.common_names]
    check_names(registry, chosen)
    back = {name: f"{name}.{registry.revoked.get(name, 0) + 1}" for name in chosen if name not in registry.common_names}
    registry = structs.replace(registry, common_names=registry.common_names | back)
    try:
        return lay_out(folder, registry, days, renew=chosen)
    except OSError as error:
        raise _unwritable(folder, error) from None


def revoke(folder: Path, names: Sequence[str]) -> list[str]:
    """Remove `names` from all allow lists; return the machines whose rules changed. Raises Refused.

    Routers read the rules when they open: restart them.
    """
    registry = load(folder)
    check_names(registry, names)
    count = {name: registry.revoked.get(name, 0) + 1 for name in names if name in registry.common_names}
    left = {name: common for name, common in registry.common_names.items() if name not in names}
    registry = structs.replace(registry, common_names=left, revoked=registry.revoked | count)
    try:
        try:
            lay_out(folder, registry, DAYS, renew=())
        except Unsigned:  # what others wait for holds no revocation up
            shut_out(folder, registry)
    except OSError as error:
        raise _unwritable(folder, error) from None
    return list(registry.plan.hosts)


def kept_on(folder: Path, machine: str) -> list[str]:
    """Return the members whose keys are on `machine`, or were: what is to be revoked when it is lost. Raises Refused.

    A robot that has moved leaves a copy, of which nobody can say that it was deleted.
    """
    registry = load(folder)
    plan, laid = registry.plan, {host for hosts in registry.laid.values() for host in hosts}
    if machine not in laid | plan.hosts.keys():
        raise Refused(f"--machine {machine}: must be one of {', '.join(sorted(laid | plan.hosts.keys()))}")
    here = plan.kept_at(machine)
    return here + [name for name in plan.places if machine in registry.laid.get(name, ()) and name not in here]


def show(folder: Path, now_ms: int) -> list[Shown]:
    """Return all members, with their state at the wall clock time `now_ms` [ms]. Raises Refused."""
    registry, shown = load(folder), []
    for name in registry.members():
        common = registry.common_names.get(name)
        until = validity(folder / ISSUED / f"{name}.pem")[1] if common else None
        state = "revoked" if until is None else "expired" if until.timestamp() * 1000.0 < now_ms else "valid"
        at = registry.plan.places[name]
        text = "" if until is None else f"{until:%Y-%m-%d %H:%M}"
        shown.append(Shown(name, state, common or "", text, at, tuple(sayable(name, registry.plan)) if common else ()))
    return shown


def requested(folder: Path, names: Sequence[str] = ()) -> list[Path]:
    """Write requests for the members (all of `names`) whose certificate an outside authority has yet to sign.

    Return their paths. Raises Refused where the authority is the fleet's own.
    """
    registry = load(folder)
    if not registry.outside:
        raise Refused(f"{folder}: signs by itself, requests are for an outside authority (lfa keys init --ca-cert)")
    check_names(registry, names)
    return write_requests(folder, registry, names)


def _unwritable(folder: Path, error: OSError) -> Refused:
    return Refused(f"{error.filename or folder}: {error.strerror}, must be a folder that can be written")
