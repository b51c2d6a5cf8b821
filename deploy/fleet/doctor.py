"""`lfa doctor`: check the machines of a fleet, or this one; print one line per check, with the required value."""

from __future__ import annotations

import asyncio
import socket
import sys
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import msgspec
import typer
from msgspec import Struct

from lfa.deploy.fleet import fleet_view
from lfa.deploy.fleet.host.host import Found
from lfa.deploy.fleet.plan import host_plan as parts
from lfa.deploy.fleet.plan.fleet_file import FleetPlan, Machine, load
from lfa.deploy.fleet.plan.host_plan import HostPlan
from lfa.deploy.fleet.remote.hosts import CLOCK_S_MAX, ask
from lfa.deploy.fleet.remote.key_distribution import operator
from lfa.deploy.fleet.remote.ssh import PYTHON_MIN, Probed, Shell, Unreachable, probe, python_of, reach
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.topics import HOST_PREFIX
from lfa.protocol.transport.zenoh_config import answers, default_endpoint

EXTRAS = {"world": ("numpy", "pymunk"), "view": ("mcap", "matplotlib", "rerun"), "deploy": ("asyncssh", "rich")}
KNOCK_S = 3.0


class Diagnosis(Struct, frozen=True):
    """Result of one check on one host."""

    host: str
    check: str
    ok: bool
    says: str


def command(
    file: Annotated[
        Path | None, typer.Argument(help="Fleet file, to check all its machines. Default: this machine.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print as JSON.")] = False,
) -> int:
    """Run `lfa doctor`; return 1 when a check fails."""
    found = this_machine() if file is None else asyncio.run(examine(load(file)))
    if as_json:
        print(msgspec.json.encode({"ok": all(one.ok for one in found), "findings": found}).decode())
    else:
        for one in found:
            print(f"{'ok   ' if one.ok else 'WRONG'}  {one.host:<12} {one.check:<12} {one.says}")
    return 0 if all(one.ok for one in found) else 1


# --- this machine -----------------------------------------------------------------------------------------------------


def this_machine() -> list[Diagnosis]:
    """Check Python, `lfa`, its extras, and the routers of the fleets that run on this machine."""
    is_ = ".".join(map(str, sys.version_info[:3]))
    found = [_finding("here", "python", sys.version_info >= PYTHON_MIN, is_, "3.11 or newer")]
    try:
        found.append(Diagnosis("here", "lfa", True, version("lfa")))
    except PackageNotFoundError:
        found.append(Diagnosis("here", "lfa", False, "is not installed: pip install lfa"))
    for extra, modules in EXTRAS.items():
        absent = [module for module in modules if find_spec(module) is None]
        says = "there" if not absent else f"without {', '.join(absent)}: pip install 'lfa[{extra}]' where it is needed"
        found.append(Diagnosis("here", f"[{extra}]", True, says))
    running = fleet_view.here()
    for part in running:
        found += _own_part(part)
    if not running:
        there = answers(default_endpoint())
        says = f"{default_endpoint()} {'answers' if there else 'does not answer: lfa-router, or lfa up, starts one'}"
        found.append(Diagnosis("here", "router", there, says))
    return found


def _own_part(part: HostPlan) -> list[Diagnosis]:
    """Check the router of this machine, and those of the other machines as reachable from here."""
    try:
        known = part.known_as(f"{HOST_PREFIX}{part.host}")
    except Refused as refused:
        return [Diagnosis(part.host, "certificate", False, str(refused))]
    found = [_router(part.host, answers(part.socket, known))]
    far = [end for end in part.others if not answers(end, known)]
    says = "all answer" if not far else f"{', '.join(far)} do not answer: must be up, and their ports open"
    return [*found, Diagnosis(part.host, "other hosts", not far, says)] if part.others else found


# --- all machines of a file -------------------------------------------------------------------------------------------


async def examine(plan: FleetPlan) -> list[Diagnosis]:
    """Check all machines of `plan` concurrently. Starts nothing except a short listener at the router's port."""
    shares = parts.parts(plan, "", "")
    each = await asyncio.gather(*(_examine(name, plan, shares[name]) for name in plan.hosts))
    return [finding for found in each for finding in found]


async def _examine(name: str, plan: FleetPlan, part: HostPlan) -> list[Diagnosis]:
    machine = plan.hosts[name]
    try:
        shell = await reach(machine)
    except Unreachable as error:
        return [Diagnosis(name, "ssh", False, str(error))]
    how = "here, without ssh" if machine.local else f"lets us in at {machine.ssh or machine.address}"
    found = [Diagnosis(name, "ssh", True, how)]
    try:
        asked = clock.wall_ms()
        probed = await probe(shell, python_of(machine))
        found += _probed(name, probed, part, (asked + clock.wall_ms()) / 2.0)
        if probed.lfa == part.version:
            found += await _place(name, shell, plan, part)
    except (Unreachable, Refused) as error:
        found.append(Diagnosis(name, "python", False, str(error)))
    finally:
        await shell.close()
    return found


def _probed(name: str, probed: Probed, part: HostPlan, here_ms: float) -> list[Diagnosis]:
    off_s = (probed.wall_ms - here_ms) / 1000.0
    says = f"{off_s:+.1f} s off this one's"
    right = f"within {CLOCK_S_MAX:g} s (timedatectl set-ntp true)"
    return [
        Diagnosis(name, "python", True, ".".join(map(str, probed.python))),
        _finding(name, "lfa", probed.lfa == part.version, probed.lfa or "none", f"{part.version} (lfa up --install)"),
        _finding(name, "clock", abs(off_s) <= CLOCK_S_MAX, says, right),
    ]


async def _place(name: str, shell: Shell, plan: FleetPlan, part: HostPlan) -> list[Diagnosis]:
    """Check folder, router, certificates and port of a machine; the port is tested from this machine."""
    machine = plan.hosts[name]
    try:
        state: Found = await ask(shell, machine, "check", part)
    except Refused as refused:
        return [Diagnosis(name, "place", False, str(refused))]
    found = [Diagnosis(name, "place", True, part.state)]
    if state.run:
        found.append(_router(name, state.router))
    if state.certificate:
        found.append(Diagnosis(name, "certificate", False, state.certificate))
    if part.port == 0 or machine.local:
        return found
    where, known = parts.endpoint(plan, name), operator(plan)
    open_ = await (asyncio.to_thread(answers, where, known) if state.run else _knock(shell, machine, part))
    right = "reachable from here: a firewall, or a router that is not up?"
    return [*found, _finding(name, "port", open_, where, right)]


async def _knock(shell: Shell, machine: Machine, part: HostPlan) -> bool:
    """Start a short listener on the machine and return True if a connection from here reaches it."""
    listening = asyncio.create_task(ask(shell, machine, "listen", part))
    until = clock.now() + KNOCK_S
    through = False
    while not through and not listening.done() and clock.now() < until:
        try:
            if part.over_udp:
                await asyncio.to_thread(_knock_udp, machine)
            else:
                opening = asyncio.open_connection(machine.address, machine.router_port)
                _, writer = await asyncio.wait_for(opening, 0.5)
                writer.close()
            through = True
        except (OSError, TimeoutError):
            await asyncio.sleep(0.1)
    await listening
    return through


def _knock_udp(machine: Machine) -> None:
    """Send a UDP packet to the router's port and wait for the echo. Raises OSError when none arrives."""
    where = socket.getaddrinfo(machine.address, machine.router_port, type=socket.SOCK_DGRAM)[0]
    with socket.socket(where[0], socket.SOCK_DGRAM) as knocking:
        knocking.settimeout(0.5)
        knocking.connect(where[4])
        knocking.send(b"lfa")
        knocking.recv(64)


def _router(host: str, there: bool) -> Diagnosis:
    return Diagnosis(host, "router", there, "answers" if there else f"does not answer: see lfa logs {host}/router")


def _finding(host: str, check: str, ok: bool, says: str, right: str) -> Diagnosis:
    return Diagnosis(host, check, ok, says if ok else f"{says}: must be {right}")
