"""`lfa up`: start the processes of a fleet file on its machines, all or none; return when all robots are in the chain.

The machine that runs it is not needed afterwards. A second run starts what is missing, such as a returned machine.
"""

from __future__ import annotations

import asyncio
import hashlib
import sys
import time
from math import inf
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer
from msgspec.structs import replace

from lfa.agents.orders.roster_orders import QUESTION
from lfa.deploy.fleet import fleet_view
from lfa.deploy.fleet.fleet_view import Seen
from lfa.deploy.fleet.health import Health
from lfa.deploy.fleet.host.start_check import Found
from lfa.deploy.fleet.plan.fleet_file import FleetPlan, load
from lfa.deploy.fleet.plan.host_plan import HostPlan, parts, store
from lfa.deploy.fleet.remote.hosts import FleetHosts
from lfa.deploy.fleet.remote.key_distribution import Bundle, bundles
from lfa.deploy.fleet.security.private_files import ISSUED
from lfa.deploy.process.signals import Interrupts
from lfa.deploy.terminal_text import print_visible
from lfa.protocol import clock
from lfa.protocol.errors import Refused

POLL_S = 0.05
ASK_S = 0.2
"""Time [s] between questions to the leader who is in the team: spares may have joined, and robots retired."""
HEALTHY_S = 0.3
"""Duration [s] for which the fleet must be healthy without interruption."""


class NotUp(Exception):
    """Failure to bring the fleet up, with a line for each cause and the exit code; no process of it is left."""

    def __init__(self, lines: list[str], code: int) -> None:
        super().__init__("\n".join(lines))
        self.lines = lines
        self.code = code


def command(
    file: Annotated[Path, typer.Argument(help="A fleet file (deploy/fleet.example.toml is one).")],
    install: Annotated[
        bool, typer.Option("--install", help="Install this version of lfa on the machines first.")
    ] = False,
    secure: Annotated[
        bool, typer.Option("--secure", help="Require certificates of every process; deny all that is not allowed.")
    ] = False,
    system: Annotated[
        bool, typer.Option("--system", help="Let the machines' systemd run the processes, as system units.")
    ] = False,
    boot: Annotated[
        bool, typer.Option("--boot", help="Let systemd start the processes when a machine is switched on.")
    ] = False,
    wait: Annotated[float, typer.Option(help="Time limit [s] for the fleet to become healthy.")] = 60.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print how it went as JSON.")] = False,
) -> int:
    if not 0.0 < wait < inf:
        raise Refused(f"--wait {wait:g}: must be above 0, in seconds")
    plan = _chosen(load(file), secure=secure, system=system, boot=boot)
    began = clock.now()
    try:
        with Interrupts() as interrupts:
            facts = asyncio.run(bring_up(plan, interrupts, may_install=install, wait_s=wait))
    except NotUp as not_up:
        if as_json:
            print_visible(msgspec.json.encode({"fleet": plan.name, "healthy": False, "wrong": not_up.lines}).decode())
        for line in not_up.lines:
            print_visible(f"lfa: {line}", file=sys.stderr)
        return not_up.code
    took_s = round(clock.now() - began, 2)
    if as_json:
        print_visible(msgspec.json.encode({"fleet": plan.name, "healthy": True, "took_s": took_s, **facts}).decode())
    else:
        chain = " <- ".join(map(str, facts["chain"]))
        print_visible(f"fleet {plan.name} is up after {took_s:.1f} s: {chain}")
        print_visible(f"next: lfa ps {file}, lfa logs -f robot{facts['chain'][0]}, lfa top {file}, lfa down {file}")
    return 0


def _chosen(plan: FleetPlan, *, secure: bool, system: bool, boot: bool) -> FleetPlan:
    """Return the plan with what the options add to its file; `--boot` needs an engine that starts at boot."""
    file = plan.file
    engine = "systemd-system" if system else "systemd" if boot and file.engine == "own" else file.engine
    return replace(plan, file=replace(file, secure=secure or file.secure, engine=engine, boot=boot or file.boot))


async def bring_up(plan: FleetPlan, interrupts: Interrupts, *, may_install: bool, wait_s: float) -> dict[str, Any]:
    """Bring the fleet up and return its chain and hosts. Raises NotUp, after ending everything started here."""
    digest, keys = digest_of(plan), bundles(plan)
    fleet = FleetHosts(plan, parts(plan, f"{time.strftime('%Y%m%d-%H%M%S')}-{digest}", digest, keys))
    try:
        await fleet.reach()
        found = await fleet.check(may_install=may_install)
        _all_well(fleet)
        _join_those_that_run(plan, fleet, found, digest, keys)
        fresh = [name for name in plan.hosts if not found[name].run]
        tell(f"starting {len(fresh)} of {len(found)} hosts")
        started = await fleet.do("start")
        for name in (name for name in fresh if name in started and started[name].note):
            tell(f"host {name}: {started[name].note}")
        if fleet.wrong:
            raise NotUp(fleet.lines(), 1)
        starts = len(fresh) == len(plan.hosts)
        return await asyncio.to_thread(await_health, plan, fleet.parts, interrupts, wait_s, starts=starts)
    except NotUp as not_up:
        lines = await _take_down(fleet, locals().get("fresh", []))
        raise NotUp([*not_up.lines, *lines], not_up.code) from None
    finally:
        await fleet.close()


async def _take_down(fleet: FleetHosts, names: list[str]) -> list[str]:
    """End the machines' parts that this `lfa up` has started; return a line for each machine where that failed."""
    if not names:
        return []
    before, fleet.wrong = fleet.wrong, {name: "" for name in fleet.parts if name not in names}
    await fleet.do("stop")
    left = [f"host {name}: {line}" for name, line in fleet.wrong.items() if line]
    fleet.wrong = before
    return left or [f"taken down again: {', '.join(names)}"]


def _all_well(fleet: FleetHosts) -> None:
    if fleet.wrong:
        raise NotUp(fleet.lines(), 1 if fleet.unreached == set(fleet.wrong) else 2)


def _join_those_that_run(
    plan: FleetPlan, fleet: FleetHosts, found: dict[str, Found], digest: str, keys: dict[str, Bundle]
) -> None:
    """Make the others join the run of the machines that run already, which must have the same digest (NotUp)."""
    for name, one in found.items():
        if one.run and one.digest != digest:
            fleet.wrong[name] = f"runs fleet {plan.name} from another file, or an older state of it: lfa down first"
    if fleet.wrong:
        raise NotUp(fleet.lines(), 2)
    run = max((one.run for one in found.values()), default="")
    if run:
        fleet.parts = parts(plan, run, digest, keys)


def await_health(
    plan: FleetPlan, shares: dict[str, HostPlan], interrupts: Interrupts, wait_s: float, *, starts: bool = False
) -> dict[str, Any]:
    """Observe the fleet until it has been healthy for HEALTHY_S; return its chain and hosts. Raises NotUp.

    `starts`: no machine ran a part of it before.
    """
    own = next((part for part in fleet_view.here() if part.fleet == plan.name), None)
    endpoints = [own.socket] if own is not None else []
    endpoints += [end for part in shares.values() for end in part.others[:1]]
    seen = Seen(plan.name, ",".join(dict.fromkeys(endpoints)), tuple(plan.hosts), own, plan, store(plan) / ISSUED)
    health = Health(plan.scenario.mission.robots, tuple(plan.hosts), starts=starts)
    began, well_since, shown = clock.now(), None, ""
    ask_at = began
    try:
        with fleet_view.open_view(seen) as view:
            while True:
                for at, message in view.hear():
                    health.see(at, message)
                now = clock.now()
                if now >= ask_at:
                    ask_at = now + ASK_S
                    view.ask(QUESTION)
                lost, missing = health.lost(now - began), health.missing(now)
                if lost:
                    raise NotUp(lost, 1)
                if interrupts.signal is not None:
                    raise NotUp([f"ended by {interrupts.signal.name}"], 128 + interrupts.signal)
                if missing and now - began > wait_s:
                    raise NotUp([f"not healthy within {wait_s:g} s:", *missing], 1)
                well_since = None if missing else well_since or now
                if well_since is not None and now - well_since >= HEALTHY_S:
                    return {"chain": health.chain(now), "hosts": list(plan.hosts)}
                shown = _progress(missing, shown)
                clock.sleep(POLL_S)
    except Refused as refused:
        raise NotUp([str(refused)], 1) from None


def _progress(missing: list[str], shown: str) -> str:
    """Print each change of the missing items once; return the text shown last."""
    text = f"waiting: {missing[0]}{f', and {len(missing) - 1} more' if len(missing) > 1 else ''}" if missing else ""
    if text and text != shown:
        tell(text)
    return text


def tell(text: str) -> None:
    """Print a line of progress."""
    print_visible(text, file=sys.stderr, flush=True)


def digest_of(plan: FleetPlan) -> str:
    """Return the digest of a fleet's file and scenario, by which its machines know that they run the same."""
    said = msgspec.json.encode((plan.file, plan.scenario), order="deterministic")
    return hashlib.sha256(said).hexdigest()[:8]
