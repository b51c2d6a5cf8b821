"""The keys of a fleet file's fleet: made on the operator's machine, and what of them goes to which machine.

They lie in `~/.local/state/lfa/<fleet>.keys`, or where the file's `keys` says; who has that folder is the operator.
"""

from __future__ import annotations

from lfa.deploy.fleet.plan.fleet_file import FleetPlan
from lfa.deploy.fleet.plan.host_plan import parts, store
from lfa.deploy.fleet.remote.hosts import FleetHosts
from lfa.deploy.fleet.security import keys
from lfa.deploy.fleet.security.access_rules import KeyPlan, host_name
from lfa.deploy.fleet.security.private_files import ISSUED
from lfa.protocol import clock
from lfa.protocol.names import WITNESS_NAME, robot_name
from lfa.protocol.topics import OPERATOR_NAME, WORLD_NAME
from lfa.protocol.transport.credentials import Credentials, credentials

Bundle = dict[str, str]
"""File name to text: all small, all text."""


def key_plan(plan: FleetPlan) -> KeyPlan:
    """Who joins where: at home, and where a process goes that has lost its router."""
    file = plan.file
    homes = {robot_name(robot): host for robot, host in plan.places.items()} | {WORLD_NAME: file.world}
    if plan.scenario.mission.witness and file.witness != file.world:
        homes[WITNESS_NAME] = file.witness
    homes |= {host_name(host): host for host in plan.hosts}
    addresses = {name: (machine.address,) for name, machine in plan.hosts.items()}
    places = {name: (home, *plan.seconds(home)) for name, home in homes.items()}
    return keys.spread(plan.name, addresses, plan.places, places)


def operator(plan: FleetPlan) -> Credentials | None:
    """What the operator shows, None where no keys were made yet. Raises Refused."""
    issued = store(plan) / ISSUED
    return credentials(issued, OPERATOR_NAME, clock.wall_ms()) if issued.is_dir() else None


def bundles(plan: FleetPlan) -> dict[str, Bundle]:
    """The keys of each machine, made where they are missing. Raises Refused."""
    keys.make(store(plan), key_plan(plan))
    return _bundles(plan)


def _bundles(plan: FleetPlan) -> dict[str, Bundle]:
    folders = {name: keys.folder_of(store(plan), name) for name in plan.hosts}
    return {name: {path.name: path.read_text() for path in sorted(at.iterdir())} for name, at in folders.items()}


async def push(plan: FleetPlan) -> list[str]:
    """Give the machines of a running fleet their keys anew, and open their routers one by one; a line for each fault.

    Rules are read when a router opens. While one is away its processes go to the next machine's, as when it dies.
    """
    fleet = FleetHosts(plan, parts(plan, "", "", _bundles(plan)))
    try:
        await fleet.reach()
        for name in plan.hosts:
            await fleet.do("rekey", [name])
    finally:
        await fleet.close()
    return fleet.lines()
