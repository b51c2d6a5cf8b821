"""`lfa restart`: terminate one process of a fleet in order and start it again, on any machine."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import msgspec
import typer

from lfa.deploy.fleet.fleet_view import FleetView, await_first_status, find, open_view
from lfa.deploy.terminal_text import print_visible
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.messages.fleet import ProcessReport

HEAR_S = 2.0
AGAIN_S = 10.0


def command(
    process: Annotated[str, typer.Argument(help="robot3 (or 3), world, witness, router.")],
    file: Annotated[Path | None, typer.Argument(help="The fleet file. Default: the fleet that runs here.")] = None,
    host: Annotated[str | None, typer.Option(help="Machine of the process, for a router.")] = None,
    fleet: Annotated[str | None, typer.Option(help="Name of the fleet, when several run here.")] = None,
    connect: Annotated[str | None, typer.Option(help="Endpoint of a router of the fleet, when none runs here.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> int:
    name = f"robot{process}" if process.isdecimal() else process
    seen = find(file, fleet, connect)
    with open_view(seen) as view:
        await_first_status(view, HEAR_S)
        place = host or _place(view, name)
        before = _report(view, place, name)
        if before is None:
            raise Refused(f"{process}: host {place} has no such process: must be one of {', '.join(_names(view))}")
        order = view.order("restart", f"{place}/{name}")
        began = clock.now()

        def again() -> bool:
            after = _report(view, place, name)
            return after is not None and after.starts > before.starts and after.state == "running"

        done = view.say_until(order, again, AGAIN_S)
        took_s = round(clock.now() - began, 2)
    if as_json:
        print_visible(
            msgspec.json.encode({"process": name, "host": place, "restarted": done, "took_s": took_s}).decode()
        )
    elif done:
        print_visible(f"{name} on {place} was started again after {took_s:.1f} s")
    else:
        print_visible(f"{name} on {place} was not started again within {AGAIN_S:g} s: see lfa logs {name}")
    return 0 if done else 1


def _place(view: FleetView, name: str) -> str:
    places = [host for host, status in view.hosts.items() if any(r.name == name for r in status.processes)]
    if not places:
        raise Refused(f"{name}: no host that is heard has it: must be one of {', '.join(_names(view))}")
    if len(places) > 1:
        raise Refused(f"{name}: several hosts have one: say --host {' or --host '.join(sorted(places))}")
    return places[0]


def _report(view: FleetView, host: str, name: str) -> ProcessReport | None:
    status = view.hosts.get(host)
    return next((r for r in status.processes if r.name == name), None) if status is not None else None


def _names(view: FleetView) -> list[str]:
    return sorted({report.name for status in view.hosts.values() for report in status.processes})
