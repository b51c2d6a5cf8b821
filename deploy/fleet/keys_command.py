"""`lfa keys`: create, renew, revoke and show a fleet's certificates and publish rights."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import typer

from lfa.deploy.fleet.plan.fleet_file import FleetPlan, is_fleet_file, load
from lfa.deploy.fleet.plan.host_plan import store
from lfa.deploy.fleet.remote.key_distribution import push
from lfa.deploy.fleet.security import keys, registry
from lfa.deploy.fleet.security.access_rules import KeyPlan, host_name
from lfa.deploy.process.coroutines import run_to_end
from lfa.deploy.terminal_text import print_visible
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.topics import fleet_name
from lfa.world.description.checks import ROBOTS_MAX

DAYS_MAX = 36500.0


def command(
    action: Annotated[Literal["init", "csr", "rotate", "revoke", "show"], typer.Argument(help="What to do.")],
    folder: Annotated[Path, typer.Argument(help="Folder of the keys (machine a's in hosts/a), or a fleet file.")],
    names: Annotated[
        list[str] | None, typer.Argument(help="rotate, revoke, show: members, such as robot3, world, host-a.")
    ] = None,
    machine: Annotated[
        str | None, typer.Option(help="revoke: all whose keys are on this machine, when it is lost.")
    ] = None,
    robots: Annotated[int, typer.Option(help="init: number of robots N, with ids 1 to N.")] = 4,
    hosts: Annotated[str, typer.Option(help="init: machines with addresses: a=10.0.0.1+a.lan,b=10.0.0.2.")] = "local",
    place: Annotated[
        list[str] | None,
        typer.Option(help="init: machines whose routers a member may join, home first: robot3=b+a; repeatable."),
    ] = None,
    driver: Annotated[
        list[int] | None, typer.Option(help="init: id of a robot with a hardware driver; repeatable.")
    ] = None,
    fleet: Annotated[str, typer.Option(help="init: name of the fleet, part of every key expression.")] = "fleet",
    ca_cert: Annotated[
        Path | None, typer.Option("--ca-cert", help="init: certificate of an outside authority, which is to sign.")
    ] = None,
    days: Annotated[float, typer.Option(help="init, rotate: validity of certificates [days].")] = keys.DAYS,
    as_json: Annotated[bool, typer.Option("--json", help="Print as JSON.")] = False,
) -> int:
    chosen = names or []
    plan = load(folder) if is_fleet_file(folder) else None
    if plan is not None:
        if action == "init":
            raise Refused(f"{folder}: lfa up makes the keys of a fleet file by itself")
        folder = store(plan)
    if not 0.0 < days <= DAYS_MAX:
        raise Refused(f"--days {days:g}: must be above 0 and at most {DAYS_MAX:g}")
    if action == "init" and chosen:
        raise Refused(f"init {' '.join(chosen)}: must be a folder alone, --robots and --hosts say who is in the fleet")
    if machine is not None and action != "revoke":
        raise Refused(f"--machine {machine}: must stand with revoke")
    if machine is not None:
        chosen = list(dict.fromkeys([*chosen, *keys.kept_on(folder, machine)]))
    if action == "revoke" and not chosen:
        raise Refused("revoke: say whom, as in lfa keys revoke DIR robot3, or --machine b")
    if ca_cert is not None and action != "init":
        raise Refused(f"--ca-cert {ca_cert}: must stand with init")
    if action == "init":
        return _init(folder, planned(fleet, hosts, robots, place or [], driver or []), days, ca_cert, as_json)
    if action == "csr":
        paths = [str(path) for path in keys.requested(folder, chosen)]
        return _say({"requests": paths}, "\n".join(paths) or "all certificates are signed", as_json)
    if action != "show":
        return _change(action, folder, chosen, days, plan, machine, as_json)
    return _show(folder, chosen, as_json)


def _change(
    action: Literal["rotate", "revoke"],
    folder: Path,
    chosen: list[str],
    days: float,
    plan: FleetPlan | None,
    lost: str | None,
    as_json: bool,
) -> int:
    """Rotate or revoke keys, then distribute them over ssh if there is a fleet file, else print what is to be done."""
    if action == "rotate":
        changed, text = keys.rotate(folder, chosen, days), "renewed (whoever runs shows it from its next start on)"
    else:
        keys.revoke(folder, chosen)
        changed, text = chosen, "revoked"
    machines = [name for name in registry.load(folder).plan.hosts if name != lost]
    wrong = [] if plan is None else run_to_end(push(plan, lost))
    then = "routers opened anew" if plan is not None else "copy hosts/ again, then SIGHUP to the routers, one by one"
    facts: dict[str, object] = {"changed": changed, "hosts": machines, "pushed": plan is not None, "wrong": wrong}
    for line in wrong:
        print_visible(f"lfa: {line}", file=sys.stderr)
    _say(facts, f"{', '.join(changed)} {text}; {then}: {', '.join(machines)}", as_json)
    return 1 if wrong else 0


def planned(fleet: str, hosts: str, robots: int, places: list[str], drivers: list[int]) -> KeyPlan:
    """Return the key plan given by the options. Raises Refused."""
    if not 1 <= robots <= ROBOTS_MAX:
        raise Refused(f"--robots {robots}: must be from 1 to {ROBOTS_MAX}")
    machines: dict[str, tuple[str, ...]] = {}
    for word in hosts.split(","):
        name, _, addresses = word.partition("=")
        if not name.strip(".") or not all(c.isalnum() or c in "-_." for c in name) or name in machines:
            raise Refused(f"--hosts {hosts}: must be names, each once, like a=10.0.0.1,b")
        machines[name] = tuple(address for address in addresses.split("+") if address)
    said = {word.partition("=")[0]: word.partition("=")[2].split("+") for word in places}
    return keys.spread(fleet_name(fleet), machines, range(1, robots + 1), said, drivers)


def _init(folder: Path, plan: KeyPlan, days: float, ca_cert: Path | None, as_json: bool) -> int:
    made = keys.make(folder, plan, days, ca_cert)
    machines = {host: str(registry.folder_of(folder, host)) for host in plan.hosts}
    lines = [f"{len(made)} certificates made, {len(plan.places)} in all: {folder}"]
    for host, path in machines.items():
        lines.append(f"machine {host}: {path}  (lfa-router --keys DIR --secure; {', '.join(plan.kept_at(host))})")
    return _say({"made": made, "hosts": machines}, "\n".join(lines), as_json)


def _show(folder: Path, names: list[str], as_json: bool) -> int:
    shown = [one for one in keys.show(folder, clock.wall_ms()) if not names or one.name in names]
    if not shown:
        raise Refused(f"{' '.join(names)}: no member of this fleet, must be like robot1, world or {host_name('a')}")
    if as_json:
        print_visible(msgspec.json.encode(shown).decode())
        return 0
    for one in shown:
        print_visible(f"{one.name:<12} {one.state:<8} {one.until or '-':<17} joins at {', '.join(one.joins_at)}")
        for key in one.says if names else ():
            print_visible(f"{'':<12} may say {key}")
    return 0


def _say(facts: dict[str, object], text: str, as_json: bool) -> int:
    print_visible(msgspec.json.encode(facts).decode() if as_json else text)
    return 0
