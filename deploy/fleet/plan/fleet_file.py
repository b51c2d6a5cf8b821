"""The fleet file: machines, placement of processes, links, restart policy. Reads and checks it; starts nothing."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Literal

from msgspec import Struct
from msgspec.structs import replace

from lfa.deploy.process.restart_policy import Restart
from lfa.deploy.scenario_loading import load_scenario
from lfa.protocol.config_file.conversion import convert
from lfa.protocol.config_file.mistake import Mistake, Range, Rule, apply_rules, out_of_range, wrong
from lfa.protocol.config_file.toml_file import read_toml
from lfa.protocol.errors import Refused
from lfa.protocol.mission import Profile
from lfa.world.description.load import Scenario, draw
from lfa.world.description.placement import SEED_MAX

NAME = re.compile(r"[a-z0-9][a-z0-9-]{0,30}")
LOCAL = ("localhost", "127.0.0.1", "::1")
ROUTER_PORT = 7447
PORT_MAX = 65535

Engine = Literal["own", "systemd", "systemd-system"]
"""What starts and watches a machine's processes."""


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
    """Timing profile: `std` for wired links, `wifi` for radio, `auto` for busy machines. Default: the scenario's."""
    world: str = ""
    """Machine of the simulated world. Default: the first."""
    witness: str = ""
    """Machine of the witness. Default: the world's machine, in the world's process."""
    robots: Robots = Robots()
    links: LinkPlan = LinkPlan()
    restart: Restart = Restart()
    engine: Engine = "own"
    """Engine of the processes: our own supervisor, the user's systemd, or the machine's (also `lfa up --system`)."""
    boot: bool = False
    """True: systemd starts the processes when the machine is switched on (also `lfa up --boot`)."""
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


def is_fleet_file(path: Path) -> bool:
    """Return True for a TOML file with a table `hosts`, which a scenario does not have."""
    try:
        return "hosts" in read_toml(path, "a fleet file").document
    except Refused:
        return False


def load(path: Path) -> FleetPlan:
    """Return the plan of a fleet file. Raises RefusedFile with all mistakes."""
    toml = read_toml(path, "a fleet file")
    file, mistakes = convert(toml.document, FleetFile, SEED_MAX)
    if not file.hosts and not mistakes:
        mistakes.append(Mistake("hosts", " = {}: must have at least one machine, as [hosts.NAME]"))
    if file.hosts:
        first = next(iter(file.hosts))
        file = replace(file, fleet=file.fleet or path.name.partition(".")[0], world=file.world or first)
        file = replace(file, witness=file.witness or file.world)
        apply_rules(FLEET_RULES, file, mistakes)
    scenario = _scenario(file, path, mistakes)
    if scenario is not None:
        apply_rules((Rule(partial(_placed, robots=scenario.robots), ("scenario", "set")),), file, mistakes)
    if mistakes or scenario is None:
        raise toml.refuse(mistakes)
    return FleetPlan(path, file, scenario, _places(file, scenario.robots))


def _scenario(file: FleetFile, path: Path, mistakes: list[Mistake]) -> Scenario | None:
    beside = path.parent / file.scenario
    overrides = [*file.set, *([f"mission.profile='{file.profile}'"] if file.profile else [])]
    try:
        named = str(beside) if beside.suffix == ".toml" else file.scenario
        return draw(load_scenario(named, overrides, file.team), file.seed)
    except Refused as refused:
        mistakes += [Mistake("scenario", f" = {file.scenario}: {line}") for line in refused.lines]
        return None


def _places(file: FleetFile, robots: tuple[int, ...]) -> dict[int, str]:
    """Return the machine of each robot: from `robots.on`, else in turn over `robots.spread`."""
    spread = [name for word in file.robots.spread for name in _called(file, word)] or list(file.hosts)
    free = [robot for robot in robots if str(robot) not in file.robots.on]
    dealt = {robot: spread[n % len(spread)] for n, robot in enumerate(free)}
    return {robot: file.robots.on.get(str(robot), dealt.get(robot, "")) for robot in robots}


def _called(file: FleetFile, word: str) -> list[str]:
    return [name for name, machine in file.hosts.items() if word == name or word in machine.labels]


def _placed(file: FleetFile, robots: tuple[int, ...]) -> Iterator[Mistake]:
    right = f"one of {', '.join(map(str, robots))}"
    for robot, host in file.robots.on.items():
        if robot not in map(str, robots):
            yield Mistake(f"robots.on.{robot}", f" = {host}: no such robot in the scenario: must be {right}")


def _names(file: FleetFile) -> Iterator[Mistake]:
    """Find names that are none, and names of machines that the fleet does not have."""
    if not NAME.fullmatch(file.fleet):
        yield wrong("fleet", file.fleet, _NAME)
    places = {"world": file.world, "witness": file.witness}
    if file.witness == file.world:
        del places["witness"]
    places |= {f"robots.on.{robot}": host for robot, host in file.robots.on.items()}
    hosts = f"one of the hosts: {', '.join(file.hosts)}"
    for key, host in places.items():
        if host not in file.hosts:
            yield wrong(key, host, hosts)
    for n, word in enumerate(file.robots.spread):
        if not _called(file, word):
            yield wrong(f"robots.spread[{n}]", word, f"{hosts}, or a label of some")
    for n, (a, b) in enumerate(file.links.pairs):
        key, value = f"links.pairs[{n}]", f"[{a}, {b}]"
        for x in (a, b):
            if x not in file.hosts:
                yield Mistake(key, f" = {value}: {x} must be {hosts}")
        if a == b:
            yield wrong(key, value, "two machines")


def _engine(file: FleetFile) -> Iterator[Mistake]:
    if file.boot and file.engine == "own":
        yield wrong("boot", "true", 'false, or engine = "systemd", which can start at boot')


def _restart(file: FleetFile) -> Iterator[Mistake]:
    restart = file.restart
    return out_of_range(
        (
            Range("restart.delay_s", restart.delay_s, 0.0, 600.0),
            Range("restart.delay_max_s", restart.delay_max_s, restart.delay_s, 3600.0, "restart.delay_s"),
            Range("restart.window_s", restart.window_s, 1.0, 86400.0),
            Range("restart.starts_max", restart.starts_max, 0, 1000),
            Range("restart.watchdog_s", restart.watchdog_s, 2.0, 3600.0),
        )
    )


def _machines(file: FleetFile) -> Iterator[Mistake]:
    for name, machine in file.hosts.items():
        yield from _machine(f"hosts.{name}", name, machine)


def _machine(where: str, name: str, machine: Machine) -> Iterator[Mistake]:
    if not NAME.fullmatch(name):
        yield Mistake(where, f": must be called by {_NAME}")
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9.:_-]*", machine.address):
        yield wrong(f"{where}.address", machine.address, "a host's name or an IP address")
    if machine.python and machine.venv:
        yield Mistake(f"{where}.venv", f" = {machine.venv}: must not be given beside python")
    if not 0 <= machine.port <= PORT_MAX:
        yield wrong(f"{where}.port", machine.port, f"a port, 1 to {PORT_MAX}")
    if not 1 <= machine.router_port <= PORT_MAX:
        yield wrong(f"{where}.router_port", machine.router_port, f"a port, 1 to {PORT_MAX}")
    if machine.state and not machine.state.startswith(("/", "~/")):
        yield Mistake(f"{where}.state", f" = {machine.state}: must begin with / or ~/")


def _together(file: FleetFile) -> Iterator[Mistake]:
    """Find machines that cannot be in one fleet."""
    local = [name for name, machine in file.hosts.items() if machine.address in LOCAL]
    if local and len(local) < len(file.hosts):
        for name in local:
            yield wrong(f"hosts.{name}.address", file.hosts[name].address, "an address that the other machines reach")
    six = [name for name, machine in file.hosts.items() if ":" in machine.address]
    for name in six if len(file.hosts) > 1 and file.links.transport != "tcp" else ():
        right = 'an address of IPv4, or [links] transport = "tcp": Zenoh makes no certified link to an address of IPv6'
        yield wrong(f"hosts.{name}.address", file.hosts[name].address, right)
    seen: dict[tuple[str, int], str] = {}
    for name, machine in file.hosts.items():
        other = seen.setdefault((machine.address, machine.router_port), name)
        if other != name:
            key, at = f"hosts.{name}.router_port", f"{machine.address}:{machine.router_port}"
            says = f" = {machine.router_port}: must not be {other}'s, both are at {at}"
            yield Mistake(key, says, (key, f"hosts.{name}.address"))


_NAME = "small letters, digits and '-', at most 31"
FLEET_RULES: tuple[Rule[FleetFile], ...] = tuple(
    Rule(check) for check in (_names, _engine, _restart, _machines, _together)
)
