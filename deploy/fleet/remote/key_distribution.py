"""Keys of a fleet file's fleet: created on the operator's machine, and distributed to each machine.

They are stored in `~/.local/state/lfa/<fleet>.keys`, or in the file's `keys`; the owner of that folder is the operator.
"""

from __future__ import annotations

from lfa.deploy.fleet.plan.fleet_file import FleetPlan
from lfa.deploy.fleet.plan.host_plan import parts, store
from lfa.deploy.fleet.remote.hosts import FleetHosts
from lfa.deploy.fleet.security import keys, registry
from lfa.deploy.fleet.security.access_rules import KeyPlan, host_name
from lfa.deploy.fleet.security.private_files import ISSUED
from lfa.protocol import clock
from lfa.protocol.names import WITNESS_NAME, robot_name
from lfa.protocol.topics import OPERATOR_NAME, WORLD_NAME
from lfa.protocol.transport.credentials import Credentials, credentials

Bundle = dict[str, str]
"""Contents of small text files, by file name."""


def key_plan(plan: FleetPlan) -> KeyPlan:
    """Return the machines whose routers each process may join: its home, and those it fails over to."""
    file = plan.file
    homes = {robot_name(robot): host for robot, host in plan.places.items()} | {WORLD_NAME: file.world}
    if plan.scenario.mission.witness and file.witness != file.world:
        homes[WITNESS_NAME] = file.witness
    homes |= {host_name(host): host for host in plan.hosts}
    addresses = {name: (machine.address,) for name, machine in plan.hosts.items()}
    places = {name: (home, *plan.seconds(home)) for name, home in homes.items()}
    return keys.spread(plan.name, addresses, plan.places, places)


def operator(plan: FleetPlan) -> Credentials | None:
    """Return the operator's credentials, None before keys were created. Raises Refused."""
    issued = store(plan) / ISSUED
    return credentials(issued, OPERATOR_NAME, clock.wall_ms()) if issued.is_dir() else None


def bundles(plan: FleetPlan) -> dict[str, Bundle]:
    """Return the keys of each machine, created where missing. Raises Refused."""
    keys.make(store(plan), key_plan(plan))
    return _bundles(plan)


def _bundles(plan: FleetPlan) -> dict[str, Bundle]:
    folders = {name: registry.folder_of(store(plan), name) for name in plan.hosts}
    return {name: {path.name: path.read_text() for path in sorted(at.iterdir())} for name, at in folders.items()}


async def push(plan: FleetPlan, lost: str | None = None) -> list[str]:
    """Send new keys to the machines of a running fleet and restart their routers one by one; return a line per failure.

    A machine that is `lost` is sent nothing. A router reads its rules when it opens. During its restart its processes
    fail over to the next machine's router.
    """
    fleet = FleetHosts(plan, parts(plan, "", "", _bundles(plan)))
    try:
        await fleet.reach()
        fleet.wrong.pop(lost or "", None)
        for name in (name for name in plan.hosts if name != lost):
            await fleet.do("rekey", [name])
    finally:
        await fleet.close()
    return fleet.lines()
