"""Registry of a fleet's keys on disk: its members with their common names, and where each thing lies in the folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from msgspec import Struct, structs

from lfa.deploy.fleet.security.access_rules import KeyPlan
from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import read_given_json

REGISTRY, HOSTS, CA_KEY, REQUESTS = "fleet.json", "hosts", "ca.key", "requests"


class Registry(Struct, frozen=True):
    """Contents of `fleet.json`."""

    plan: KeyPlan
    common_names: dict[str, str] = {}
    """Common names in the certificates of admitted members. A name is not reused after a revocation."""
    outside: bool = False
    """True: an outside authority signs, whose key is not here."""
    revoked: dict[str, int] = {}
    """Number of revocations of each member."""
    laid: dict[str, tuple[str, ...]] = {}
    """Machines on which the keys of an admitted member lie, or lay under its present common name."""

    def members(self) -> list[str]:
        return list(self.plan.places)

    def with_places(self) -> Registry:
        """Return the registry with the machines of the plan among those where keys were laid."""
        now = {name: host for host in self.plan.hosts for name in self.plan.kept_at(host)}
        known = {name: self.laid.get(name, ()) for name in self.common_names}
        laid = {name: tuple(sorted({*at, now[name]} if name in now else at)) for name, at in known.items()}
        return structs.replace(self, laid={name: at for name, at in laid.items() if at})


def load(folder: Path) -> Registry:
    """Return the registry in `folder`. Raises Refused when it holds no fleet's keys."""
    return read_given_json(folder / REGISTRY, Registry, f"must be what lfa keys writes: lfa keys init {folder}")


def check_names(registry: Registry, names: Sequence[str]) -> None:
    strange = [name for name in names if name not in registry.members()]
    if strange:
        raise Refused(f"{strange[0]}: no member of fleet {registry.plan.fleet}, must be like robot1, world or host-a")


def folder_of(folder: Path, host: str) -> Path:
    """Return the folder with all files that machine `host` needs."""
    return folder / HOSTS / host
