"""The keys of a fleet file's fleet: made on the operator's machine, and what of them goes to which machine.

They lie in `~/.local/state/lfa/<fleet>.keys`, or where the file's `keys` says; who has that folder is the operator.
"""

from __future__ import annotations

from pathlib import Path

from deploy.fleet import keys
from deploy.fleet.access import Plan as KeyPlan
from deploy.fleet.access import host_name
from deploy.fleet.file import Plan
from deploy.fleet.part import KEYS, USUAL_STATE, Part
from protocol.mission import WITNESS_NAME, robot_name
from protocol.topics import WORLD_NAME

Bundle = dict[str, str]
"""File name to text: all small, all text."""


def store(plan: Plan) -> Path:
    """Where the fleet's authority lives."""
    return Path(plan.file.keys or f"{USUAL_STATE}/{plan.name}.keys").expanduser()


def key_plan(plan: Plan) -> KeyPlan:
    """Who joins where: at home, and where a process goes that has lost its router."""
    file = plan.file
    homes = {robot_name(robot): host for robot, host in plan.places.items()} | {WORLD_NAME: file.world}
    if plan.scenario.mission.witness and file.witness != file.world:
        homes[WITNESS_NAME] = file.witness
    homes |= {host_name(host): host for host in plan.hosts}
    addresses = {name: (machine.address,) for name, machine in plan.hosts.items()}
    places = {name: (home, *plan.seconds(home)) for name, home in homes.items()}
    return keys.spread(plan.name, addresses, plan.places, places)


def bundles(plan: Plan) -> dict[str, Bundle]:
    """The keys of each machine, made where they are missing. Raises Refused."""
    folder = store(plan)
    keys.make(folder, key_plan(plan))
    return {name: _read(keys.folder_of(folder, name)) for name in plan.hosts}


def _read(folder: Path) -> Bundle:
    return {path.name: path.read_text() for path in sorted(folder.iterdir())}


def unpack(part: Part) -> None:
    """Write this machine's keys, those that are no more taken away. Raises OSError."""
    folder = part.folder / KEYS
    keys.private_folder(folder)
    for path in folder.iterdir():
        if path.name not in part.bundle:
            path.unlink()
    for name, text in part.bundle.items():
        keys.write_private(folder / name, text.encode())
