"""`lfa logs`: print the last lines of a process's log, or of all, from any machine; `-f` follows."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from lfa.deploy.fleet.engine.log_tail import FOLLOW_S
from lfa.deploy.fleet.fleet_view import FleetView, await_first_status, find, open_view
from lfa.deploy.process.signals import Interrupts
from lfa.deploy.terminal_text import print_visible
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.fleet import LogLines
from lfa.protocol.output import visible
from lfa.protocol.topics import HOST_PREFIX

HEAR_S = 2.0
ANSWER_S = 5.0
QUIET_S = 0.5
AGAIN_S = FOLLOW_S / 2.0


def command(
    process: Annotated[str, typer.Argument(help="robot3 (or 3), world, witness, a/router. Default: all.")] = "",
    file: Annotated[Path | None, typer.Argument(help="The fleet file. Default: the fleet that runs here.")] = None,
    follow: Annotated[bool, typer.Option("-f", "--follow", help="Print new lines until Ctrl-C.")] = False,
    lines: Annotated[int, typer.Option("-n", "--lines", min=1, help="Number of last lines.")] = 20,
    fleet: Annotated[str | None, typer.Option(help="Name of the fleet, when several run here.")] = None,
    connect: Annotated[str | None, typer.Option(help="Endpoint of a router of the fleet, when none runs here.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object per line.")] = False,
) -> int:
    if process.endswith(".toml") and file is None:
        process, file = "", Path(process)
    target = f"robot{process}" if process.isdecimal() else process
    seen = find(file, fleet, connect)
    with open_view(seen, frozenset({"*/host", "*/log"})) as view, Interrupts() as interrupts:
        await_first_status(view, HEAR_S)
        places = _places(view, target)
        printed_at = clock.now()

        def show(_at: float, message: Message) -> None:
            nonlocal printed_at
            if isinstance(message, LogLines):
                printed_at = clock.now()
                _print(message, as_json, alone=bool(target))

        order = view.order("logs", target, lines)
        if not view.say_until(order, lambda: all(view.obeyed(order, host) for host in places), ANSWER_S, show):
            raise Refused(f"logs {target}: host {' and '.join(places)} does not answer")
        again_at = clock.now() + AGAIN_S
        while interrupts.signal is None and (follow or clock.now() - printed_at < QUIET_S):
            if follow and clock.now() >= again_at:
                again_at = clock.now() + AGAIN_S
                view.say(view.order("logs", target))
            clock.sleep(0.05)
            for at, message in view.hear():
                show(at, message)
        return 0 if interrupts.signal is None else 128 + interrupts.signal


def _places(view: FleetView, target: str) -> list[str]:
    place, _, name = target.rpartition("/")
    if not name or name in view.hosts:
        return [name] if name else list(view.hosts)
    places = [
        host
        for host, status in view.hosts.items()
        if place in ("", host) and any(report.name == name for report in status.processes)
    ]
    if not places:
        known = sorted({report.name for status in view.hosts.values() for report in status.processes})
        raise Refused(f"{target}: no host that is heard has it: must be one of {', '.join(known) or 'none'}")
    return places


def _print(said: LogLines, as_json: bool, *, alone: bool) -> None:
    host = said.header.sender.removeprefix(HOST_PREFIX)
    for line in said.lines:
        if as_json:
            print_visible(msgspec.json.encode({"host": host, "process": said.name, "line": line}).decode())
        else:
            print_visible(visible(line if alone else f"{host}/{said.name}: {line}"))
    sys.stdout.flush()
