"""`lfa down`: end all processes of a fleet on every machine, also where its router is dead."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from lfa.deploy.fleet.fleet_view import FleetView, Seen, await_first_status, find, open_view
from lfa.deploy.fleet.host import host
from lfa.deploy.fleet.plan.fleet_file import FleetPlan
from lfa.deploy.fleet.plan.host_plan import parts
from lfa.deploy.fleet.remote import journals
from lfa.deploy.fleet.remote.hosts import FleetHosts
from lfa.deploy.process.coroutines import run_to_end
from lfa.deploy.recording.run_folder import JOURNALS
from lfa.deploy.terminal_text import print_visible
from lfa.protocol import clock
from lfa.protocol.errors import Refused

HEAR_S = 2.0
GONE_S = 8.0
POLL_S = 0.05


def command(
    file: Annotated[Path | None, typer.Argument(help="The fleet file. Default: the fleet that runs here.")] = None,
    fleet: Annotated[str | None, typer.Option(help="Name of the fleet, when several run here.")] = None,
    connect: Annotated[str | None, typer.Option(help="Endpoint of a router of the fleet, when none runs here.")] = None,
    keep: Annotated[Path | None, typer.Option(help="Copy the fleet's journals into this folder (lfa replay).")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> int:
    began = clock.now()
    seen = find(file, fleet, connect)
    if keep is not None:
        _make(keep)
    ended, wrong = run_to_end(_by_shell(seen.plan)) if seen.plan is not None else _by_word(seen)
    if keep is not None:
        wrong += _bring(seen, keep)
    took_s = round(clock.now() - began, 2)
    if as_json:
        print_visible(
            msgspec.json.encode({"fleet": seen.name, "ended": ended, "wrong": wrong, "took_s": took_s}).decode()
        )
    else:
        print_visible(f"fleet {seen.name}: ended on {', '.join(ended) or 'no host'} after {took_s:.1f} s")
    for line in wrong:
        print_visible(f"lfa: {line}", file=sys.stderr)
    return 1 if wrong else 0


def _bring(seen: Seen, keep: Path) -> list[str]:
    """Copy the journals of all machines (without a fleet file: of this one) to `keep`; return a line per failure."""
    if seen.plan is not None:
        return journals.fetch(seen.plan, keep)[1]
    try:
        journals.copy({seen.part.run_folder / JOURNALS} if seen.part is not None else set(), keep)
    except OSError as error:
        return [f"--keep {keep}: {error.strerror}: the journals are not kept there"]
    return []


def _make(keep: Path) -> None:
    """Create the folder for journals, before anything is ended. Raises Refused."""
    try:
        keep.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Refused(f"--keep {keep}: {error.strerror}: must be a folder to write to") from None


async def _by_shell(plan: FleetPlan) -> tuple[list[str], list[str]]:
    """End each machine's part over ssh; return the machines that ended, and a line per failure."""
    fleet = FleetHosts(plan, parts(plan, "", ""))
    try:
        await fleet.reach()
        answers = await fleet.do("stop")
    finally:
        await fleet.close()
    return [name for name in plan.hosts if name in answers and answers[name].run], fleet.lines()


def _by_word(seen: Seen) -> tuple[list[str], list[str]]:
    """Order the other machines down over Zenoh, then end this machine's supervisor, if any, by a signal."""
    own = seen.part
    ended: list[str] = []
    wrong: list[str] = []
    if own is not None and own.hosts == (own.host,):
        host.stop(own)
        return [own.host], []
    try:
        with open_view(seen) as view:
            await_first_status(view, HEAR_S)
            far = [name for name in view.names if own is None or name != own.host]
            wrong = [f"host {name}: is not heard, and may run on" for name in far if name not in view.hosts]
            far = [name for name in far if name in view.hosts]
            ended, left = _order_down(view, far)
            wrong += [f"host {name}: does not end" for name in left]
    except Refused as refused:
        if own is None:
            raise
        wrong = [f"{refused}: only this host is ended"] if len(own.hosts) > 1 else []
    if own is not None:
        host.stop(own)
        ended.append(own.host)
    return ended, wrong


def _order_down(view: FleetView, names: list[str]) -> tuple[list[str], list[str]]:
    """Order `names` down; return those that ended and those that did not.

    The order is repeated: it may pass through the router of any of these machines.
    """
    orders = {name: view.order("down", name) for name in names}
    left = set(names)
    until, say_at = clock.now() + GONE_S, 0.0
    while left and clock.now() < until:
        if clock.now() >= say_at:
            say_at = clock.now() + 0.5
            for name in left:
                view.say(orders[name])
        clock.sleep(POLL_S)
        view.hear()
        left = {name for name in left if view.living(name)}
    return [name for name in names if name not in left], sorted(left)
