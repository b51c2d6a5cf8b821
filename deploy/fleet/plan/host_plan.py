"""What one machine is told of its fleet: one small file for its supervisor, and the processes made of it."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path

import msgspec
from msgspec import Struct

from lfa.deploy.fleet.plan.fleet_file import FleetPlan, Machine, Restart
from lfa.deploy.process.process_group import ROUTER_NAME, ProcessSpec
from lfa.deploy.recording.run_folder import JOURNALS, SCENARIO, toml
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.mission import Profile
from lfa.protocol.names import WITNESS_NAME, robot_name
from lfa.protocol.topics import WORLD_NAME
from lfa.protocol.transport.credentials import Credentials, credentials
from lfa.world.description.scenario import STATE

PART = "part.json"
SOCKET = "router.sock"
KEYS = "keys"
USUAL_STATE = "~/.local/state/lfa"


class HostPlan(Struct, frozen=True):
    """One machine's share."""

    fleet: str
    host: str
    run: str
    """Which `lfa up` it belongs to: also the name of the folder of its logs and journals."""
    digest: str
    """Of all that the fleet file says: another file, another digest."""
    version: str
    state: str
    """May begin with `~`: whose home that is, is known only there."""
    scenario: str
    """As drawn, in TOML."""
    seed: int
    robots: tuple[int, ...]
    world: bool
    witness: bool
    """A process of its own for the witness, here."""
    world_witness: bool
    """The world's process holds it."""
    listen: tuple[str, ...]
    connect: tuple[str, ...]
    others: tuple[str, ...]
    """Routers of other machines, for processes that have lost their own."""
    port: int
    """Of the router; 0: a unix socket is enough."""
    restart: Restart
    hosts: tuple[str, ...]
    """All machines of the fleet."""
    link: Profile = "std"
    """How soon a silent link counts as dead: as the mission's profile."""
    secure: bool = False
    keyed: bool = False
    """Its processes show certificates: the router does so to others, or to everybody."""
    bundle: dict[str, str] = {}
    """Keys on their way, file by file; not kept in the part."""

    @property
    def folder(self) -> Path:
        """Of this fleet on this machine."""
        return Path(self.state).expanduser()

    @property
    def run_folder(self) -> Path:
        return self.folder / self.run

    @property
    def over_udp(self) -> bool:
        """Its router listens for other machines at a port of UDP."""
        return any(where.startswith("quic/") for where in self.listen)

    def known_as(self, name: str) -> Credentials | None:
        """What `name` shows here. Raises Refused."""
        return credentials(self.folder / KEYS, name, clock.wall_ms()) if self.keyed else None

    @property
    def socket(self) -> str:
        return f"unixsock-stream/{self.folder / SOCKET}"

    @property
    def endpoint(self) -> str:
        """Where this machine's processes meet: its router, or the next when that one is lost."""
        return ",".join((self.socket, *self.others))


def parts(
    plan: FleetPlan, run: str, digest: str, bundles: Mapping[str, dict[str, str]] | None = None
) -> dict[str, HostPlan]:
    """Each machine's share of `plan`, with its keys."""
    file, names = plan.file, list(plan.hosts)
    scenario = toml(plan.scenario)
    mission = plan.scenario.mission
    made = {}
    for n, (name, machine) in enumerate(plan.hosts.items()):
        made[name] = HostPlan(
            fleet=plan.name,
            host=name,
            run=run,
            digest=digest,
            version=version("lfa"),
            state=machine.state or f"{USUAL_STATE}/{plan.name}/{name}",
            scenario=scenario,
            seed=file.seed,
            robots=plan.robots_on(name),
            world=name == file.world,
            witness=mission.witness and name == file.witness and file.witness != file.world,
            world_witness=mission.witness and file.witness == file.world,
            listen=() if len(names) == 1 else _listen(plan, machine),
            connect=tuple(endpoint(plan, far) for far in names[:n] if _joined(plan, name, far)),
            others=tuple(door(plan, far) for far in plan.seconds(name)),
            port=0 if len(names) == 1 else machine.router_port,
            restart=file.restart,
            hosts=tuple(names),
            link=mission.profile,
            secure=file.secure,
            keyed=file.secure or (len(names) > 1 and file.links.transport == "quic"),
            bundle=(bundles or {}).get(name, {}),
        )
    return made


def store(plan: FleetPlan) -> Path:
    """Where the fleet's authority lives, on the operator's machine."""
    return Path(plan.file.keys or f"{USUAL_STATE}/{plan.name}.keys").expanduser()


def endpoint(plan: FleetPlan, name: str) -> str:
    """Where other machines' routers find the router of machine `name`."""
    return f"{plan.file.links.transport}/{_at(plan.hosts[name])}"


def door(plan: FleetPlan, name: str) -> str:
    """Where processes of other machines, and the operator, find that router.

    By tls, where routers speak quic: the end of a router's process ends its tcp links at once, as the kernel tells the
    other end. A quic link ends by silence alone, a link lease later, and meanwhile nobody fails over.
    """
    return f"{_DOORS[plan.file.links.transport]}/{_at(plan.hosts[name])}"


_DOORS = {"quic": "tls", "tcp": "tcp"}


def _at(machine: Machine) -> str:
    host = f"[{machine.address}]" if ":" in machine.address else machine.address
    return f"{host}:{machine.router_port}"


def _listen(plan: FleetPlan, machine: Machine) -> tuple[str, ...]:
    """The same port number, of udp for routers and of tcp for processes."""
    where = f"{'127.0.0.1' if machine.local else '0.0.0.0'}:{machine.router_port}"
    transport = plan.file.links.transport
    return tuple(f"{kind}/{where}" for kind in dict.fromkeys((transport, _DOORS[transport])))


def _joined(plan: FleetPlan, a: str, b: str) -> bool:
    pairs = plan.file.links.pairs
    return not pairs or (a, b) in pairs or (b, a) in pairs


def rows(part: HostPlan) -> list[ProcessSpec]:
    """The processes of this machine, its router first."""
    folder = part.run_folder
    keys = ("--keys", str(part.folder / KEYS)) if part.keyed else ()
    link = ("--link", part.link)
    team = ("--fleet", part.fleet, "--connect", part.endpoint, "--journal", str(folder / JOURNALS), *link, *keys)
    guarded = (*keys, *link, "--secure") if part.secure else (*keys, *link)
    listen = (word for where in (part.socket, *part.listen) for word in ("--listen", where))
    connect = (word for where in part.connect for word in ("--connect", where))
    made = [ProcessSpec(ROUTER_NAME, ("lfa.deploy.fleet.host.router", *listen, *connect, *guarded))]
    if part.world:
        witness = () if part.world_witness else ("--no-witness",)
        world = (
            "lfa.world.cli",
            str(folder / SCENARIO),
            "--seed",
            str(part.seed),
            "--state",
            str(folder),
            *team,
            *witness,
        )
        row = ProcessSpec(WORLD_NAME, world, restart_args=("--resume", str(folder)))
        made.append(row.restarted() if (folder / STATE).exists() else row)
    if part.witness:
        made.append(ProcessSpec(WITNESS_NAME, ("lfa.agents.cli", "--role", "witness", "--id", "w", *team)))
    for robot in part.robots:
        made.append(ProcessSpec(robot_name(robot), ("lfa.agents.cli", "--role", "follower", "--id", str(robot), *team)))
    return made


def read(path: Path) -> HostPlan:
    """Raises Refused for a file that is no part of a fleet."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=HostPlan)
    except OSError as error:
        raise Refused(f"{path}: cannot be read ({error.strerror})") from None
    except msgspec.DecodeError as error:
        raise Refused(f"{path}: no part of a fleet ({error}): lfa up writes it") from None
