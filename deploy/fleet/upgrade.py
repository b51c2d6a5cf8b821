"""`lfa upgrade`: bring the machines of a running fleet, one after another, to the `lfa` installed here (E35).

Before anything changes, each machine must run this fleet with the same version of the messages, or with the one before.
Then each machine gets this `lfa`, ends its processes in order and starts them again; the leader's machine is the last.
The next one follows only when all robots are in the chain again.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Mapping, Sequence
from math import inf
from pathlib import Path
from typing import Annotated

import msgspec
import typer
from msgspec.structs import replace

from lfa.deploy.fleet.host.start_check import Found
from lfa.deploy.fleet.plan.fleet_file import FleetPlan, load
from lfa.deploy.fleet.plan.host_plan import parts
from lfa.deploy.fleet.remote.hosts import FleetHosts, StartedAs
from lfa.deploy.fleet.remote.key_distribution import bundles
from lfa.deploy.fleet.up import NotUp, await_health, digest_of, tell
from lfa.deploy.process.signals import Interrupts
from lfa.deploy.terminal_text import print_visible
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.messages.header import WIRE_VERSION


def command(
    file: Annotated[Path, typer.Argument(help="The fleet file of a fleet that runs.")],
    wait: Annotated[float, typer.Option(help="Time limit [s] until all are in the chain, for each machine.")] = 60.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print how it went as JSON.")] = False,
) -> int:
    if not 0.0 < wait < inf:
        raise Refused(f"--wait {wait:g}: must be above 0, in seconds")
    plan, began = load(file), clock.now()
    done: list[str] = []
    lines, code = [], 0
    try:
        with Interrupts() as interrupts:
            asyncio.run(_upgrade(plan, interrupts, wait, done))
    except NotUp as not_up:
        lines, code = not_up.lines, not_up.code
    took_s = round(clock.now() - began, 2)
    if as_json:
        facts = {"fleet": plan.name, "wire": WIRE_VERSION, "upgraded": done, "wrong": lines, "took_s": took_s}
        print_visible(msgspec.json.encode(facts).decode())
    elif done:
        print_visible(
            f"fleet {plan.name}: {', '.join(done)} upgraded after {took_s:.1f} s; messages of version {WIRE_VERSION}"
        )
    for line in lines:
        print_visible(f"lfa: {line}", file=sys.stderr)
    return code


async def _upgrade(plan: FleetPlan, interrupts: Interrupts, wait_s: float, done: list[str]) -> None:
    """Upgrade one machine after another; `done` collects those that are. Raises NotUp."""
    digest, keys = digest_of(plan), bundles(plan)
    fleet = FleetHosts(plan, parts(plan, "", digest, keys))
    try:
        await fleet.reach()
        found, wires = await fleet.check(may_install=False), await fleet.wires()
        await fleet.check_installs()
        lines = fleet.lines() or refusals(plan.name, found, wires, digest)
        started = {} if lines else await fleet.started_as()
        lines = lines or fleet.lines() or differing(started)
        if lines:
            raise NotUp(lines, 1 if fleet.unreached else 2)
        plan = as_started(plan, next(iter(started.values())))
        digest, keys = digest_of(plan), bundles(plan)
        fleet.parts = parts(plan, max(one.run for one in found.values()), digest, keys)
        left = list(plan.hosts)
        while left:
            chain = (await asyncio.to_thread(await_health, plan, fleet.parts, interrupts, wait_s))["chain"]
            name = next_host(left, plan.places, chain)
            tell(f"host {name}: from version {wires[name]} of the messages to {WIRE_VERSION}; robot{chain[0]} leads")
            await fleet.renew(name)
            if fleet.wrong:
                raise NotUp([*fleet.lines(), f"not upgraded: {', '.join(left)}"], 1)
            left.remove(name)
            done.append(name)
        await asyncio.to_thread(await_health, plan, fleet.parts, interrupts, wait_s)
    finally:
        await fleet.close()


def refusals(name: str, found: Mapping[str, Found], wires: Mapping[str, int], digest: str) -> list[str]:
    """Return a line for each machine that cannot be upgraded from here, by what each said; empty: all can.

    An older `lfa` may read the same file otherwise, so that its machines run another state of it; of two other states,
    one is of another file.
    """
    lines = []
    others = {one.digest for one in found.values() if one.run} - {digest}
    for host, one in found.items():
        wire = wires[host]
        if wire > WIRE_VERSION:
            right = f"must be {WIRE_VERSION} or older: upgrade from a machine with a newer lfa"
            lines.append(f"host {host}: speaks version {wire} of the messages, {right}")
        elif wire < WIRE_VERSION - 1:
            right = f"must be {WIRE_VERSION - 1} or {WIRE_VERSION}: upgrade to an lfa of version {wire + 1} first"
            lines.append(f"host {host}: speaks version {wire} of the messages, {right}")
        elif not one.run:
            lines.append(f"host {host}: does not run fleet {name}: must run, lfa up starts it")
        elif len(others) > 1 and one.digest != digest:
            lines.append(f"host {host}: runs fleet {name} from another file than others: lfa down first")
    return lines


def differing(started: Mapping[str, StartedAs]) -> list[str]:
    """Return a line for the first machine that was started otherwise than those before it; empty: all alike."""
    first, *others = started
    for name in others:
        if started[name] != started[first]:
            says = [f"host {one} with {started[one].text()}" for one in (name, first)]
            return [f"{', '.join(says)}: must be started alike, by lfa down and lfa up"]
    return []


def as_started(plan: FleetPlan, started: StartedAs) -> FleetPlan:
    """Return the plan of a fleet that runs, as it was started: also with options of `lfa up` that its file lacks."""
    file = replace(plan.file, secure=started.secure, engine=started.engine, boot=started.boot)
    return replace(plan, file=file)


def next_host(left: Sequence[str], host_of: Mapping[int, str], chain: Sequence[int]) -> str:
    """Return the machine to upgrade next: the first that does not have the leader; the leader's only as the last."""
    return next((name for name in left if name != host_of.get(chain[0])), left[0])
