"""Processes of a fleet as services of an engine: command, keys, memory. Pure, but for the keys that it is given.

An export is secured as by `lfa up --secure`: every service holds the key files of its own name, and no others.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from msgspec import Struct
from msgspec.structs import replace

from lfa.deploy.fleet.plan.fleet_file import FleetPlan
from lfa.deploy.process.process_group import ROUTER_NAME
from lfa.deploy.recording.run_folder import toml
from lfa.protocol.names import WITNESS_NAME, robot_name
from lfa.protocol.topics import HOST_PREFIX, WORLD_NAME
from lfa.protocol.transport.credentials import ACCESS_FILE, CA_FILE, USERS_FILE

Place = Literal["names", "addresses"]
"""How routers are reached: by the machines' names, which the engine resolves, or by their addresses."""
KEYS, SCENARIO = "/keys", "/scenario/scenario.toml"
"""Places of the key files and of the scenario in a container."""
USER = 10001
"""User of the images (templates/docker/Dockerfile)."""
PORT = 7447
MEMORY_MIB = {ROUTER_NAME: 512, WORLD_NAME: 1024}
AGENT_MEMORY_MIB = 256
AGENT_IMAGE, WORLD_IMAGE = "lfa-agent", "lfa-world"


class Service(Struct, frozen=True):
    """One process of a fleet as a service."""

    name: str
    """Name, unique in the fleet: `robot1`, `world`, `router-a`."""
    host: str
    image: str
    command: tuple[str, ...]
    """Whole command line in the image."""
    keys: dict[str, str]
    """Contents of its key files, by file name."""
    memory_mib: int
    router: bool = False
    scenario: bool = False
    """True: it reads the scenario."""


class FleetServices(Struct, frozen=True):
    """All services of a fleet."""

    fleet: str
    hosts: dict[str, str]
    """Address of each machine, by name."""
    services: tuple[Service, ...]
    scenario: str
    """The scenario as drawn, in TOML."""

    def on(self, host: str) -> list[Service]:
        """Return the services of one machine, its router first."""
        return [service for service in self.services if service.host == host]


def secured(plan: FleetPlan) -> FleetPlan:
    """Return the plan as `--secure` has it."""
    return replace(plan, file=replace(plan.file, secure=True))


def services(plan: FleetPlan, keys: Mapping[str, Mapping[str, str]], place: Place) -> FleetServices:
    """Return the services of a secured plan, with the `keys` of each machine."""
    made: list[Service] = []
    for host in plan.hosts:
        kept = keys[host]
        made.append(_router(plan, host, kept, place))
        homes = [robot_name(robot) for robot in plan.robots_on(host)]
        if host == plan.file.world:
            homes.insert(0, WORLD_NAME)
        if plan.scenario.mission.witness and host == plan.file.witness != plan.file.world:
            homes.append(WITNESS_NAME)
        made += [_member(plan, host, name, kept, place) for name in homes]
    addresses = {name: machine.address for name, machine in plan.hosts.items()}
    return FleetServices(plan.name, addresses, tuple(made), toml(plan.scenario))


def router_of(host: str) -> str:
    return f"{ROUTER_NAME}-{host}"


def port_of(plan: FleetPlan, host: str) -> int:
    return plan.hosts[host].router_port


def _router(plan: FleetPlan, host: str, kept: Mapping[str, str], place: Place) -> Service:
    """Return the router of a machine: tls for processes, quic for the other machines' routers."""
    port = port_of(plan, host)
    names = list(plan.hosts)
    earlier = [far for far in names[: names.index(host)] if _linked(plan, host, far)]
    listen = [word for kind in ("tls", "quic") for word in ("--listen", f"{kind}/0.0.0.0:{port}")]
    connect = [word for far in earlier for word in ("--connect", f"quic/{_at(plan, far, place)}")]
    command = ("python", "-P", "-m", "lfa.deploy.fleet.host.router", *listen, *connect, "--keys", KEYS, "--secure",
               "--link", plan.scenario.mission.profile)  # fmt: skip
    files = {**_of(kept, f"{HOST_PREFIX}{host}"), ACCESS_FILE: kept[ACCESS_FILE], USERS_FILE: kept[USERS_FILE]}
    return Service(router_of(host), host, AGENT_IMAGE, command, files, MEMORY_MIB[ROUTER_NAME], router=True)


def _member(plan: FleetPlan, host: str, name: str, kept: Mapping[str, str], place: Place) -> Service:
    """Return the service of a world, witness or robot; it connects to its own router, then to the next one."""
    own = f"127.0.0.1:{port_of(plan, host)}" if place == "addresses" else _at(plan, host, place)
    doors = ",".join(f"tls/{where}" for where in (own, *(_at(plan, far, place) for far in plan.seconds(host))))
    team = ("--fleet", plan.name, "--connect", doors, "--keys", KEYS, "--link", plan.scenario.mission.profile)
    if name == WORLD_NAME:
        apart = () if plan.file.witness == plan.file.world and plan.scenario.mission.witness else ("--no-witness",)
        command = ("lfa-world", SCENARIO, "--seed", str(plan.file.seed), *team, *apart)
        return Service(name, host, WORLD_IMAGE, command, _of(kept, name, WITNESS_NAME), MEMORY_MIB[name], scenario=True)
    role, robot = ("witness", "w") if name == WITNESS_NAME else ("follower", name.removeprefix("robot"))
    spare = ("--spare",) if any(str(one.id) == robot for one in plan.scenario.world.spares) else ()
    command = ("lfa-agent", "--role", role, "--id", robot, *team, *spare)
    return Service(name, host, AGENT_IMAGE, command, _of(kept, name), AGENT_MEMORY_MIB)


def _of(kept: Mapping[str, str], *names: str) -> dict[str, str]:
    """Return the key files of these names among those of a machine, with the authority's certificate."""
    return {file: text for file, text in kept.items() if file == CA_FILE or file.rpartition(".")[0] in names}


def _at(plan: FleetPlan, host: str, place: Place) -> str:
    address = host if place == "names" else plan.hosts[host].address
    return f"[{address}]:{port_of(plan, host)}" if ":" in address else f"{address}:{port_of(plan, host)}"


def _linked(plan: FleetPlan, a: str, b: str) -> bool:
    pairs = plan.file.links.pairs
    return not pairs or (a, b) in pairs or (b, a) in pairs
