"""`lfa top`: show the processes of a fleet by machine on one screen, live, with leader, errors, CPU and memory."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import msgspec
import typer

from lfa.deploy.client.team_status import Board
from lfa.deploy.fleet import ps
from lfa.deploy.fleet.fleet_view import FleetView, await_first_status, find, open_view
from lfa.deploy.process.signals import Interrupts
from lfa.deploy.terminal_text import cell, print_visible
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.names import robot_name

if TYPE_CHECKING:
    from rich.console import Group

HEAR_S = 2.5
FIRST_S = 1.3  # each process has published its status by then
REFRESH_S = 0.5
WIDTH_MIN = 80


def command(
    file: Annotated[Path | None, typer.Argument(help="The fleet file. Default: the fleet that runs here.")] = None,
    fleet: Annotated[str | None, typer.Option(help="Name of the fleet, when several run here.")] = None,
    connect: Annotated[str | None, typer.Option(help="Endpoint of a router of the fleet, when none runs here.")] = None,
    once: Annotated[bool, typer.Option("--once", help="Print once and end.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print once, as JSON.")] = False,
) -> int:
    seen = find(file, fleet, connect)
    if not (once or as_json or sys.stdout.isatty()):
        raise Refused("top needs a terminal: use --once or --json")
    import rich.console
    import rich.live
    import rich.table  # noqa: F401

    board = Board()
    with open_view(seen) as view:
        await_first_status(view, HEAR_S)
        _hear_for(view, board, FIRST_S)
        if as_json:
            print_visible(msgspec.json.encode(_facts(view, board)).decode())
        elif once:
            from rich.console import Console

            Console(width=max(WIDTH_MIN, shutil.get_terminal_size().columns)).print(_screen(view, board))
        else:
            _live(view, board)
    return 0


def _live(view: FleetView, board: Board) -> None:
    from rich.live import Live

    with Interrupts() as interrupts, Live(screen=True, auto_refresh=False) as live:
        while interrupts.signal is None:
            live.update(_screen(view, board), refresh=True)
            _hear_for(view, board, REFRESH_S)


def _hear_for(view: FleetView, board: Board, duration_s: float) -> None:
    until = clock.now() + duration_s
    while clock.now() < until:
        clock.sleep(0.05)
        for at, message in view.hear():
            board.see(at, message)
    board.sample(clock.now())


def _facts(view: FleetView, board: Board) -> dict[str, Any]:
    now = clock.now()
    leader = board.leader(now)
    silent = view.silent(now)
    return {
        "fleet": view.seen.name,
        "leader": leader,
        "silent": silent,
        "processes": ps.rows(view),
        "robots": [msgspec.to_builtins(row) for row in board.rows(now)],
    }


def _screen(view: FleetView, board: Board) -> Group:
    from rich.console import Group
    from rich.table import Table

    facts = _facts(view, board)
    robots = {robot_name(row["robot"]): row for row in facts["robots"]}
    made = Table(box=None, padding=(0, 1, 0, 0), pad_edge=False)
    for head in ("host", "process", "state", "starts", "role", "ahead", "off slot", "pose", "CPU", "mem", "says"):
        left = head in ("host", "process", "state", "role", "says")
        made.add_column(head, justify="left" if left else "right", no_wrap=head != "says")
    for row in facts["processes"]:
        robot = robots.get(row["process"], {})
        style = "bold red" if row["state"] != "running" else "bold green" if robot.get("role") == "leader" else ""
        cells = (row["host"], row["process"], row["state"], str(row["starts"]), *_cells(row, robot))
        made.add_row(*map(cell, cells), style=style)
    who = "nobody leads" if facts["leader"] is None else f"robot {facts['leader']} leads"
    silent = f"; silent: {', '.join(facts['silent'])}" if facts["silent"] else ""
    return Group(cell(f"fleet {facts['fleet']}: {who}{silent}", style="bold"), made)


def _cells(row: dict[str, Any], robot: dict[str, Any]) -> tuple[str, ...]:
    def shown(name: str, form: str, factor: float = 1.0) -> str:
        value = robot.get(name)
        return "" if value is None else form.format(factor * value)

    return (
        robot.get("role", ""),
        shown("predecessor", "{:.0f}"),
        shown("error_m", "{:.0f} mm", 1000.0),
        shown("pose_age_s", "{:.0f} ms", 1000.0),
        shown("cpu_percent", "{:.0f} %"),
        shown("rss_mib", "{:.0f} M"),
        row["ended"] if row["state"] != "running" else robot.get("state", ""),
    )
