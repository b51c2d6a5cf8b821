"""The fleet file: machines, placement of processes, links, restart policy. Reads and checks it; starts nothing."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal

from msgspec import Struct
from msgspec.structs import replace

from lfa.deploy.fleet.plan import tables
from lfa.deploy.scenario_loading import load_scenario
from lfa.protocol.errors import Refused
from lfa.protocol.mission import Profile
from lfa.world.description.load import Scenario, draw
from lfa.world.description.toml_file import read_toml

NAME = re.compile(r"[a-z0-9][a-z0-9-]{0,30}")
LOCAL = ("localhost", "127.0.0.1", "::1")
ROUTER_PORT = 7447
PORT_MAX = 65535

Policy = Literal["never", "on-failure", "always"]


class Machine(Struct, frozen=True, forbid_unknown_fields=True):
    """One machine. Omitted values are left to ssh: user, port and key come from `~/.ssh/config`."""

    address: str = "localhost"
    """Address at which the other machines reach it. `localhost`: this machine, without ssh."""
    ssh: str = ""
    """Name for ssh, such as a `Host` of `~/.ssh/config`. Default: its address."""
    user: str = ""
    port: int = 0
    """Port of its ssh server; 0: from ssh's configuration, else 22."""
    python: str = ""
    """Python with `lfa` on that machine. Default: `python3`; on this machine: the one that runs this command."""
    venv: str = ""
    """Virtual environment on that machine, instead of `python`; `lfa up --install` creates it."""
    state: str = ""
    """Folder of logs, journals and sockets. Default: `~/.local/state/lfa/<fleet>/<host>`."""
    labels: tuple[str, ...] = ()
    """Further names of the machine in `robots.spread`."""
    router_port: int = ROUTER_PORT

    @property
    def local(self) -> bool:
        return self.address in LOCAL and not self.ssh


class Robots(Struct, frozen=True, forbid_unknown_fields=True):
    """Placement of the robots on machines."""

    spread: tuple[str, ...] = ()
    """Machines or labels over which robots not in `on` are distributed in turn. Default: all."""
    on: dict[str, str] = {}
    """Machine of single robots, by id: `3 = "pi-3"`."""


class LinkPlan(Struct, frozen=True, forbid_unknown_fields=True):
    """Links between the machines' routers."""

    transport: Literal["quic", "tcp"] = "quic"
    """`quic`: encrypted, both ends show a certificate of this fleet. `tcp`: neither, for a trusted network."""
    pairs: tuple[tuple[str, str], ...] = ()
    """Pairs of machines whose routers are linked. Default: all pairs."""
    failover: bool = True
    """True: a process whose router is lost connects to the next machine's router."""


class Restart(Struct, frozen=True, forbid_unknown_fields=True):
    """Restart policy for processes that end, except routers, which are always restarted."""

    policy: Policy = "on-failure"
    delay_s: float = 0.5
    """Delay [s] before the first restart; doubled for each further restart within the window."""
    delay_max_s: float = 10.0
    window_s: float = 60.0
    starts_max: int = 5
    """Maximum number of restarts within the window; at the next end the process is not restarted."""


class FleetFile(Struct, frozen=True, forbid_unknown_fields=True):
    """Contents of a fleet file, the input of `lfa up`."""

    hosts: dict[str, Machine]
    scenario: str = "paper_path1"
    """Name of a shipped scenario, or of a file beside this one."""
    fleet: str = ""
    """Name of the fleet, part of every key. Default: the name of this file."""
    seed: int = 0
    set: tuple[str, ...] = ()
    """Overrides of scenario fields: `["world.lidar.beams=90"]`."""
    team: int | None = None
    """Team size N, for a team 1..N instead of the scenario's."""
    profile: Profile | None = None
    """Timing profile: `std` for wired links, `wifi` for radio. Default: the scenario's."""
    world: str = ""
    """Machine of the simulated world. Default: the first."""
    witness: str = ""
    """Machine of the witness. Default: the world's machine, in the world's process."""
    robots: Robots = Robots()
    links: LinkPlan = LinkPlan()
    restart: Restart = Restart()
    secure: bool = False
    """True: every process shows a certificate, and everything not allowed is denied (also `lfa up --secure`)."""
    keys: str = ""
    """Folder of the fleet's authority, on the operator's machine. Default: `~/.local/state/lfa/<fleet>.keys`."""


class FleetPlan(Struct, frozen=True):
    """Checked fleet file with all defaults resolved, its scenario, and the placement of the robots."""

    path: Path
    file: FleetFile
    scenario: Scenario
    places: dict[int, str]
    """Machine of each robot, by id."""

    @property
    def name(self) -> str:
        return self.file.fleet

    @property
    def hosts(self) -> dict[str, Machine]:
        return self.file.hosts

    def seconds(self, home: str) -> tuple[str, ...]:
        """Return the machines whose routers a process of `home` fails over to, in order; only one if secured."""
        if not self.file.links.failover:
            return ()
        names = list(self.hosts)
        at = names.index(home)
        following = names[at + 1 :] + names[:at]
        return tuple(following[:1] if self.file.secure else following)

    def robots_on(self, host: str) -> tuple[int, ...]:
        return tuple(robot for robot, place in self.places.items() if place == host)


class Mistaken(Refused):
    """Refusal of a fleet file, with one line for each mistake."""

    def __init__(self, path: Path, mistakes: list[str]) -> None:
        self.lines = tuple(f"{path}: {mistake}" for mistake in mistakes)
        super().__init__("; ".join(self.lines))


def is_fleet_file(path: Path) -> bool:
    """Return True for a TOML file with a table `hosts`, which a scenario does not have."""
    try:
        return "hosts" in read_toml(path, "a fleet file")
    except Refused:
        return False


def load(path: Path) -> FleetPlan:
    """Return the plan of a fleet file. Raises Refused, and Mistaken with every mistake at once."""
    document = read_toml(path, "a fleet file")
    mistakes: list[str] = []
    file = tables.read(document, FleetFile, mistakes)
    if file is None or not file.hosts:
        raise Mistaken(path, mistakes or ["hosts = {}: must have at least one machine, as [hosts.NAME]"])
    first = next(iter(file.hosts))
    file = replace(file, fleet=file.fleet or path.name.partition(".")[0], world=file.world or first)
    file = replace(file, witness=file.witness or file.world)
    mistakes += _wrong(file)
    scenario = _scenario(file, path, mistakes)
    places = {} if scenario is None else _places(file, scenario.mission.robots, mistakes)
    if mistakes or scenario is None:
        raise Mistaken(path, mistakes)
    return FleetPlan(path, file, scenario, places)


def _scenario(file: FleetFile, path: Path, mistakes: list[str]) -> Scenario | None:
    beside = path.parent / file.scenario
    overrides = [*file.set, *([f"mission.profile='{file.profile}'"] if file.profile else [])]
    try:
        named = str(beside) if beside.suffix == ".toml" else file.scenario
        return draw(load_scenario(named, overrides, file.team), file.seed)
    except Refused as refused:
        mistakes.append(f"scenario = {file.scenario}: {refused}")
        return None


def _places(file: FleetFile, robots: tuple[int, ...], mistakes: list[str]) -> dict[int, str]:
    """Return the machine of each robot: from `robots.on`, else in turn over `robots.spread`."""
    right = f"one of {', '.join(map(str, robots))}"
    for robot, host in file.robots.on.items():
        if robot not in map(str, robots):
            mistakes.append(f"robots.on.{robot} = {host}: no such robot in the scenario: must be {right}")
    spread = [name for word in file.robots.spread for name in _called(file, word, mistakes)] or list(file.hosts)
    free = [robot for robot in robots if str(robot) not in file.robots.on]
    dealt = {robot: spread[n % len(spread)] for n, robot in enumerate(free)}
    return {robot: file.robots.on.get(str(robot), dealt.get(robot, "")) for robot in robots}


def _called(file: FleetFile, word: str, mistakes: list[str]) -> list[str]:
    named = [name for name, machine in file.hosts.items() if word == name or word in machine.labels]
    if not named:
        mistakes.append(f"robots.spread = {word}: must be {_one_of(file.hosts)}, or a label of some")
    return named


def _wrong(file: FleetFile) -> list[str]:
    """Return the mistakes that the types of the single values do not reveal."""
    wrong = [] if NAME.fullmatch(file.fleet) else [f"fleet = {file.fleet}: must be {_NAMES}"]
    places = {"world": file.world, "witness": file.witness}
    if file.witness == file.world:
        del places["witness"]
    places |= {f"robots.on.{robot}": host for robot, host in file.robots.on.items()}
    wrong += [
        f"{key} = {host}: must be {_one_of(file.hosts)}" for key, host in places.items() if host not in file.hosts
    ]
    for name, machine in file.hosts.items():
        wrong += _wrong_machine(name, machine)
    wrong += _wrong_together(file)
    for a, b in file.links.pairs:
        wrong += [f"links.pairs = [{a}, {b}]: {x} must be {_one_of(file.hosts)}" for x in (a, b) if x not in file.hosts]
        wrong += [f"links.pairs = [{a}, {b}]: must be two machines"] if a == b else []
    restart = file.restart
    for key, value, low, high in (
        ("delay_s", restart.delay_s, 0.0, 600.0),
        ("delay_max_s", restart.delay_max_s, restart.delay_s, 3600.0),
        ("window_s", restart.window_s, 1.0, 86400.0),
        ("starts_max", restart.starts_max, 0, 1000),
    ):
        if not low <= value <= high:
            wrong.append(f"restart.{key} = {value:g}: must be from {low:g} to {high:g}")
    return wrong


def _wrong_machine(name: str, machine: Machine) -> list[str]:
    where, wrong = f"hosts.{name}", []
    if not NAME.fullmatch(name):
        wrong.append(f"{where}: must be called by {_NAMES}")
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9.:_-]*", machine.address):
        wrong.append(f"{where}.address = {machine.address}: must be a host's name or an IP address")
    if machine.python and machine.venv:
        wrong.append(f"{where}.venv = {machine.venv}: must not be given beside python")
    if not 0 <= machine.port <= PORT_MAX:
        wrong.append(f"{where}.port = {machine.port}: must be a port, 1 to {PORT_MAX}")
    if not 1 <= machine.router_port <= PORT_MAX:
        wrong.append(f"{where}.router_port = {machine.router_port}: must be a port, 1 to {PORT_MAX}")
    if machine.state and not machine.state.startswith(("/", "~/")):
        wrong.append(f"{where}.state = {machine.state}: must begin with / or ~/")
    return wrong


def _wrong_together(file: FleetFile) -> list[str]:
    """Return the mistakes in machines that cannot be in one fleet."""
    wrong = []
    local = [name for name, machine in file.hosts.items() if machine.address in LOCAL]
    if local and len(local) < len(file.hosts):
        wrong += [
            f"hosts.{name}.address = {file.hosts[name].address}: must be an address that the other machines reach"
            for name in local
        ]
    seen: dict[tuple[str, int], str] = {}
    for name, machine in file.hosts.items():
        other = seen.setdefault((machine.address, machine.router_port), name)
        if other != name:
            at = f"{machine.address}:{machine.router_port}"
            wrong.append(f"hosts.{name}.router_port = {machine.router_port}: must not be {other}'s, both are at {at}")
    return wrong


def _one_of(hosts: dict[str, Machine]) -> str:
    return f"one of the hosts: {', '.join(hosts)}"


_NAMES = "small letters, digits and '-', at most 31"
