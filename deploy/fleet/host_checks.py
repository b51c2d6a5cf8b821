"""Checks of all machines of a fleet file for `lfa doctor`. Needs what connects to machines: ssh and certificates."""

from __future__ import annotations

import asyncio
import socket

from lfa.deploy.fleet.doctor import Diagnosis, judged, router_diagnosis
from lfa.deploy.fleet.host.start_check import Found
from lfa.deploy.fleet.plan import host_plan
from lfa.deploy.fleet.plan.fleet_file import FleetPlan, Machine
from lfa.deploy.fleet.plan.host_plan import HostPlan
from lfa.deploy.fleet.remote.hosts import CLOCK_S_MAX, ask
from lfa.deploy.fleet.remote.key_distribution import operator
from lfa.deploy.fleet.remote.ssh import Probed, Shell, Unreachable, probe, python_of, reach
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.transport.zenoh_config import answers

KNOCK_S = 3.0


async def examine(plan: FleetPlan) -> list[Diagnosis]:
    """Check all machines of `plan` concurrently. Starts nothing except a short listener at the router's port."""
    shares = host_plan.parts(plan, "", "")
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
        judged(name, "lfa", probed.lfa == part.version, probed.lfa or "none", f"{part.version} (lfa up --install)"),
        judged(name, "clock", abs(off_s) <= CLOCK_S_MAX, says, right),
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
        found.append(router_diagnosis(name, state.router))
    if state.certificate:
        found.append(Diagnosis(name, "certificate", False, state.certificate))
    if part.port == 0 or machine.local:
        return found
    where, known = host_plan.endpoint(plan, name), operator(plan)
    open_ = await (asyncio.to_thread(answers, where, known) if state.run else _knock(shell, machine, part))
    right = "reachable from here: a firewall, or a router that is not up?"
    return [*found, judged(name, "port", open_, where, right)]


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
