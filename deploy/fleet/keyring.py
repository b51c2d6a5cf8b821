"""`lfa keys`: the fleet's certificates, and who may say what."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import msgspec
import typer

from deploy.fleet import keys
from deploy.fleet.access import Plan, host_name
from protocol import clock
from protocol.mission import Refused


def command(
    action: Annotated[Literal["init", "rotate", "revoke", "show"], typer.Argument(help="What to do.")],
    folder: Annotated[Path, typer.Argument(help="Where the keys are; machine a's own are in hosts/a.")],
    names: Annotated[list[str] | None, typer.Argument(help="Of rotate, revoke, show: robot3, world, host-a.")] = None,
    robots: Annotated[int, typer.Option(help="init: ids 1 to N.")] = 4,
    hosts: Annotated[str, typer.Option(help="init: machines, with addresses: a=10.0.0.1+a.lan,b=10.0.0.2.")] = "local",
    place: Annotated[
        list[str] | None, typer.Option(help="init: at whose routers one joins, home first: robot3=b+a; again for more.")
    ] = None,
    driver: Annotated[
        list[int] | None, typer.Option(help="init: a robot with hardware of its own; again for more.")
    ] = None,
    fleet: Annotated[str, typer.Option(help="init: name of the fleet, part of every key.")] = "fleet",
    days: Annotated[float, typer.Option(help="init, rotate: how long certificates are valid.")] = keys.DAYS,
    as_json: Annotated[bool, typer.Option("--json", help="Print as JSON.")] = False,
) -> int:
    chosen = names or []
    if days <= 0.0:
        raise Refused(f"--days {days:g}: must be above 0")
    if action == "revoke" and not chosen:
        raise Refused("revoke: say whom, as in lfa keys revoke DIR robot3")
    if action == "init":
        return _init(folder, planned(fleet, hosts, robots, place or [], driver or []), days, as_json)
    if action == "rotate":
        made = keys.rotate(folder, chosen, days)
        return _say(
            {"renewed": made}, f"renewed {', '.join(made)}; copy hosts/ again, they count at the next start", as_json
        )
    if action == "revoke":
        machines = keys.revoke(folder, chosen)
        facts: dict[str, object] = {"revoked": chosen, "restart": machines}
        text = f"revoked {', '.join(chosen)}; copy hosts/ again and restart the routers, one by one:"
        return _say(facts, f"{text} {', '.join(machines)}", as_json)
    return _show(folder, chosen, as_json)


def planned(fleet: str, hosts: str, robots: int, places: list[str], drivers: list[int]) -> Plan:
    """The plan that the options say. Raises Refused."""
    if robots < 1:
        raise Refused(f"--robots {robots}: must be 1 or more")
    machines: dict[str, tuple[str, ...]] = {}
    for word in hosts.split(","):
        name, _, addresses = word.partition("=")
        if not name or not all(c.isalnum() or c in "-_." for c in name) or name in machines:
            raise Refused(f"--hosts {hosts}: must be names, each once, like a=10.0.0.1,b")
        machines[name] = tuple(address for address in addresses.split("+") if address)
    said = {word.partition("=")[0]: word.partition("=")[2].split("+") for word in places}
    return keys.spread(fleet, machines, range(1, robots + 1), said, drivers)


def _init(folder: Path, plan: Plan, days: float, as_json: bool) -> int:
    made = keys.make(folder, plan, days)
    machines = {host: str(keys.folder_of(folder, host)) for host in plan.hosts}
    lines = [f"{len(made)} certificates made, {len(plan.places)} in all: {folder}"]
    for host, path in machines.items():
        lines.append(f"machine {host}: {path}  (lfa-router --keys DIR --secure; {', '.join(plan.kept_at(host))})")
    return _say({"made": made, "hosts": machines}, "\n".join(lines), as_json)


def _show(folder: Path, names: list[str], as_json: bool) -> int:
    shown = [one for one in keys.show(folder, clock.wall_ms()) if not names or one.name in names]
    if not shown:
        raise Refused(f"{' '.join(names)}: no member of this fleet, must be like robot1, world or {host_name('a')}")
    if as_json:
        print(msgspec.json.encode(shown).decode())
        return 0
    for one in shown:
        print(f"{one.name:<12} {one.state:<8} {one.until or '-':<17} joins at {', '.join(one.joins_at)}")
        for key in one.says if names else ():
            print(f"{'':<12} may say {key}")
    return 0


def _say(facts: dict[str, object], text: str, as_json: bool) -> int:
    print(msgspec.json.encode(facts).decode() if as_json else text)
    return 0
