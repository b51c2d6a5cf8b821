"""`lfa export`: write the units or manifests of a fleet file for an engine, with keys as its secrets; or the world of a
scenario, as SDF or as a ROS map.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import typer
from msgspec.structs import replace

from lfa.deploy.fleet.export.compose import compose
from lfa.deploy.fleet.export.kubernetes import kubernetes
from lfa.deploy.fleet.export.nomad import nomad
from lfa.deploy.fleet.export.quadlet import quadlet
from lfa.deploy.fleet.export.services import PORT, USER, secured, services
from lfa.deploy.fleet.export.systemd import RUN, state_of, systemd
from lfa.deploy.fleet.plan.fleet_file import FleetPlan, load
from lfa.deploy.fleet.plan.host_plan import parts
from lfa.deploy.fleet.remote.key_distribution import bundles
from lfa.deploy.fleet.security.private_files import private_folder, write_private
from lfa.deploy.terminal_text import print_visible
from lfa.deploy.whole_output import whole_folder
from lfa.protocol.errors import Refused

WORLDS = ("sdf", "map")
"""What a scenario's world is exported as."""
NEXT = {
    "systemd": "on each machine, in its folder: sh install.sh",
    "quadlet": "on each machine, in its folder: sh install.sh",
    "compose": "docker compose -f {folder}/compose.yaml up",
    "kubernetes": "kubectl apply -f {folder}/lfa.yaml -f {folder}/secrets.yaml",
    "nomad": "in {folder}: sh install.sh",
}


def command(
    engine: Annotated[
        Literal["systemd", "quadlet", "compose", "kubernetes", "nomad", "sdf", "map"],
        typer.Argument(help="Engine to export for; sdf, map: the world of a scenario."),
    ],
    file: Annotated[Path, typer.Argument(help="A fleet file (deploy/fleet.example.toml is one), or a scenario.")],
    out: Annotated[Path | None, typer.Option(help="New or empty folder. Default: FLEET-ENGINE.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the written files as JSON.")] = False,
) -> int:
    if engine in WORLDS:
        return _world(engine, str(file), out, as_json)
    plan = secured(load(file))
    folder = out or Path(f"{plan.name}-{engine}")
    _check_empty(folder)
    files = exported(engine, plan)
    _write(folder, files)
    then = NEXT[engine].format(folder=folder)
    if as_json:
        print_visible(msgspec.json.encode({"folder": str(folder), "files": sorted(files), "next": then}).decode())
    else:
        print_visible(f"{len(files)} files in {folder}, private keys among them\nnext: {then}")
    return 0


def _world(kind: str, scenario: str, out: Path | None, as_json: bool) -> int:
    """Write the world of a scenario. Raises Refused."""
    from lfa.deploy.worlds.world_export import export_world  # needs the extra `world`

    folder, files = export_world(kind, scenario, out)
    facts = {"folder": str(folder), "files": files}
    print_visible(msgspec.json.encode(facts).decode() if as_json else f"{' and '.join(files)} in {folder}")
    return 0


def exported(engine: str, plan: FleetPlan) -> dict[str, str]:
    """Return the files of a secured plan's export by path; keys are created where missing. Raises Refused."""
    if engine in ("compose", "kubernetes"):
        strange = [name for name, machine in plan.hosts.items() if machine.router_port != PORT]
        if strange:
            raise Refused(
                f"hosts.{strange[0]}.router_port: must be {PORT}, each router has an address of its own there"
            )
    keys = bundles(plan)
    if engine == "systemd":
        shares = parts(plan, RUN, "", keys)
        return systemd({host: replace(part, state=state_of(plan.name, host)) for host, part in shares.items()})
    fleet = services(plan, keys, "names" if engine in ("compose", "kubernetes") else "addresses")
    if engine == "compose":
        return compose(fleet, USER if os.geteuid() == 0 else os.geteuid())
    return {"kubernetes": kubernetes, "nomad": nomad, "quadlet": quadlet}[engine](fleet)


def _check_empty(folder: Path) -> None:
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise Refused(f"--out {folder}: is there already, must be a new or an empty folder")


def _write(folder: Path, files: dict[str, str]) -> None:
    """Write the files, which only their owner can read; as root, keys for containers get the containers' user."""
    try:
        with whole_folder(folder) as fresh:
            for path, text in files.items():
                place = fresh / path
                private_folder(place.parent)
                write_private(place, text.encode())
                if os.geteuid() == 0 and path.startswith("keys/"):
                    os.chown(place, USER, USER)
            private_folder(fresh)
        private_folder(folder)
    except OSError as error:
        raise Refused(f"--out {folder}: {error.strerror}: must be a place to write to") from None
