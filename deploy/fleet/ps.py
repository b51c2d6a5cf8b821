"""`lfa ps`: list the processes of a fleet by machine, as reported by its supervisors."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import msgspec
import typer

from lfa.deploy.fleet.fleet_view import FleetView, await_first_status, find, open_view
from lfa.deploy.terminal_text import cell, print_visible
from lfa.protocol import clock
from lfa.protocol.names import robot_id_of
from lfa.protocol.output import visible

if TYPE_CHECKING:
    from rich.table import Table

HEAR_S = 2.5
STATUS_S = 1.2  # each process has published its status by then
WIDTH_MIN = 80


def command(
    file: Annotated[Path | None, typer.Argument(help="The fleet file. Default: the fleet that runs here.")] = None,
    fleet: Annotated[str | None, typer.Option(help="Name of the fleet, when several run here.")] = None,
    connect: Annotated[str | None, typer.Option(help="Endpoint of a router of the fleet, when none runs here.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print as JSON.")] = False,
) -> int:
    """Run `lfa ps`; return 1 when a host is silent or a process does not run."""
    seen = find(file, fleet, connect)
    with open_view(seen, frozenset({"*/host", "*/status"})) as view:
        began = clock.now()
        await_first_status(view, HEAR_S)
        while clock.now() < began + STATUS_S and not _all_have_spoken(view):
            clock.sleep(0.05)
            view.hear()
        now = clock.now()
        facts, silent, refused = rows(view), view.silent(now), view.refused
    if as_json:
        said = {"fleet": seen.name, "silent": silent, "refused": refused, "processes": facts}
        print_visible(msgspec.json.encode(said).decode())
    else:
        from rich.console import Console

        console = Console(width=max(WIDTH_MIN, shutil.get_terminal_size().columns))
        console.print(table(facts))
        for line in others_refused(refused, facts):
            print_visible(line)
        for name in silent:
            print_visible(f"host {visible(name)} is silent")
    return 1 if silent or not facts or any(row["state"] != "running" for row in facts) else 0


def _all_have_spoken(view: FleetView) -> bool:
    """Return True if each running robot has published its status."""
    running = [report.name for status in view.hosts.values() for report in status.processes if report.pid]
    return all(name in view.texts for name in running if robot_id_of(name))


def rows(view: FleetView) -> list[dict[str, Any]]:
    """Return one row per process, ordered by host and robot id."""
    return [
        {
            "host": host,
            "process": report.name,
            "state": report.state,
            "pid": report.pid,
            "starts": report.starts,
            "up_s": report.up_s,
            "refused": view.refused.get(report.name, 0),
            "says": view.texts.get(report.name, ""),
            "ended": report.ended,
        }
        for host in view.names
        if host in view.hosts
        for report in sorted(view.hosts[host].processes, key=lambda report: robot_id_of(report.name) or 0)
    ]


def table(facts: list[dict[str, Any]]) -> Table:
    from rich.table import Table

    made = Table(box=None, padding=(0, 1, 0, 0), pad_edge=False)
    caps = ("refused",) if any(row.get("refused") for row in facts) else ()  # a column that is empty nearly always
    for head in ("host", "process", "state", "pid", "starts", "up", *caps, "says"):
        right = head in ("pid", "starts", "up", *caps)
        made.add_column(head, justify="right" if right else "left", no_wrap=head != "says")
    for row in facts:
        style = "" if row["state"] == "running" else "bold red"
        says = row["says"] if row["state"] == "running" and row["says"] else row["ended"]
        cells = (row["host"], row["process"], row["state"], str(row["pid"] or ""), str(row["starts"]))
        counted = [str(row.get(name) or "") for name in caps]
        made.add_row(*map(cell, (*cells, f"{row['up_s']:.0f} s", *counted, says)), style=style)
    return made


def others_refused(refused: dict[str, int], facts: list[dict[str, Any]]) -> list[str]:
    """Return a line per member of which robots refused something and which is no process of a machine's supervisor."""
    shown = {row["process"] for row in facts}
    return [f"{n} messages or tokens of {visible(name)} refused" for name, n in refused.items() if name not in shown]
