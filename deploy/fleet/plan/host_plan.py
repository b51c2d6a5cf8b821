"""Plan of one machine: the file that its supervisor reads, and the processes derived from it."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path

from msgspec import Struct

from lfa.deploy.fleet.plan import files
from lfa.deploy.fleet.plan.fleet_file import Engine, FleetPlan, Machine
from lfa.deploy.process.process_group import ROUTER_NAME, ProcessSpec
from lfa.deploy.process.restart_policy import Restart
from lfa.deploy.recording.run_folder import JOURNALS, SCENARIO, toml
from lfa.protocol import clock
from lfa.protocol.file_reading import read_given_json
from lfa.protocol.mission import Profile
from lfa.protocol.names import WITNESS_NAME, robot_name
from lfa.protocol.topics import WORLD_NAME
from lfa.protocol.transport.credentials import Credentials, credentials
from lfa.world.description.scenario import STATE

PART = files.PART
KEYS = "keys"
USUAL_STATE = "~/.local/state/lfa"


class HostPlan(Struct, frozen=True):
    """Share of one machine in a fleet."""

    fleet: str
    host: str
    run: str
    """Identifier of the `lfa up` that it belongs to, also the name of the folder of its logs and journals."""
    digest: str
    """Digest of the fleet file and the scenario: two different files have different digests."""
    version: str
    state: str
    """State folder; may begin with `~`, which is expanded on the machine itself."""
    scenario: str
    """Scenario as drawn, in TOML."""
    seed: int
    robots: tuple[int, ...]
    world: bool
    witness: bool
    """True: the witness runs on this machine in its own process."""
    world_witness: bool
    """True: the witness runs in the world's process."""
    listen: tuple[str, ...]
    connect: tuple[str, ...]
    others: tuple[str, ...]
    """Endpoints of other machines' routers, for processes that have lost their own."""
    port: int
    """Port of the router; 0: unix socket only."""
    restart: Restart
    hosts: tuple[str, ...]
    """Names of all machines of the fleet."""
    link: Profile = "std"
    """Profile that sets when a silent link counts as dead; equals the mission's profile."""
    secure: bool = False
    keyed: bool = False
    """True: processes show certificates; the router does so to other routers, or to every process if secured."""
    spares: tuple[int, ...] = ()
    """Ids of the robots, here and elsewhere, that the mission does not name."""
    engine: Engine = "own"
    boot: bool = False
    """True: systemd starts the processes when the machine is switched on."""
    bundle: dict[str, str] = {}
    """Contents of the key files by file name, for transfer to the machine; not stored in the plan's file."""

    @property
    def folder(self) -> Path:
        """Folder of this fleet on this machine."""
        return Path(self.state).expanduser()

    @property
    def run_folder(self) -> Path:
        return self.folder / self.run

    @property
    def over_udp(self) -> bool:
        """True if its router listens for other machines at a UDP port."""
        return any(where.startswith("quic/") for where in self.listen)

    def known_as(self, name: str) -> Credentials | None:
        """Return the credentials of `name` on this machine, None if it uses none. Raises Refused."""
        return credentials(self.folder / KEYS, name, clock.wall_ms()) if self.keyed else None

    @property
    def socket(self) -> str:
        return f"unixsock-stream/{self.folder / files.SOCKET}"

    @property
    def endpoint(self) -> str:
        """Endpoints for this machine's processes: its router, then the routers to fail over to."""
        return ",".join((self.socket, *self.others))


def parts(
    plan: FleetPlan, run: str, digest: str, bundles: Mapping[str, dict[str, str]] | None = None
) -> dict[str, HostPlan]:
    """Return the plan of each machine, with its keys."""
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
            spares=tuple(spare.id for spare in plan.scenario.world.spares),
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
            engine=file.engine,
            boot=file.boot,
            bundle=(bundles or {}).get(name, {}),
        )
    return made


def store(plan: FleetPlan) -> Path:
    """Return the folder of the fleet's certificate authority, on the operator's machine."""
    return Path(plan.file.keys or f"{USUAL_STATE}/{plan.name}.keys").expanduser()


def endpoint(plan: FleetPlan, name: str) -> str:
    """Return the endpoint at which other machines' routers reach the router of machine `name`."""
    return f"{plan.file.links.transport}/{_at(plan.hosts[name])}"


def door(plan: FleetPlan, name: str) -> str:
    """Return the endpoint at which the operator and other machines' processes reach the router of machine `name`.

    It is tls where routers use quic: when a router's process ends, the kernel closes its tcp links at once. A quic link
    ends only after a link lease of silence, and no process fails over until then.
    """
    return f"{_DOORS[plan.file.links.transport]}/{_at(plan.hosts[name])}"


_DOORS = {"quic": "tls", "tcp": "tcp"}


def _at(machine: Machine) -> str:
    host = f"[{machine.address}]" if ":" in machine.address else machine.address
    return f"{host}:{machine.router_port}"


def _listen(plan: FleetPlan, machine: Machine) -> tuple[str, ...]:
    """Return the endpoints to listen at: the same port number in UDP for routers and in TCP for processes."""
    everywhere, here = ("[::]", "[::1]") if ":" in machine.address else ("0.0.0.0", "127.0.0.1")
    where = f"{here if machine.local else everywhere}:{machine.router_port}"
    transport = plan.file.links.transport
    return tuple(f"{kind}/{where}" for kind in dict.fromkeys((transport, _DOORS[transport])))


def _joined(plan: FleetPlan, a: str, b: str) -> bool:
    pairs = plan.file.links.pairs
    return not pairs or (a, b) in pairs or (b, a) in pairs


def rows(part: HostPlan) -> list[ProcessSpec]:
    """Return the processes of this machine, its router first."""
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
        spare = ("--spare",) if robot in part.spares else ()
        agent = ("lfa.agents.cli", "--role", "follower", "--id", str(robot), *team, *spare)
        made.append(ProcessSpec(robot_name(robot), agent))
    return made


def read(path: Path) -> HostPlan:
    """Return the plan in a file that `lfa up` wrote. Raises Refused for any other file."""
    return read_given_json(path, HostPlan, "must be a host's part of a fleet, as lfa up writes it")
