"""`lfa validate`: check a scenario or a fleet file, and list every mistake in it. Starts nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import msgspec
import typer

from lfa.deploy.fleet.plan.fleet_file import is_fleet_file, load
from lfa.deploy.recording.run_folder import toml
from lfa.deploy.scenario_loading import load_scenario
from lfa.deploy.terminal_text import print_visible
from lfa.protocol.errors import Refused
from lfa.protocol.names import robot_name
from lfa.protocol.plug_in import is_file
from lfa.world.description.generator import GENERATORS
from lfa.world.description.load import draw


def command(
    scenario: Annotated[
        str,
        typer.Argument(help="A shipped scenario, a scenario file, a fleet file, or FILE.py:Class."),
    ],
    seed: Annotated[int, typer.Option(help="Seed that the scenario is drawn for.")] = 0,
    overrides: Annotated[
        list[str] | None, typer.Option("--set", help="Override a field: world.lidar.beams=90.")
    ] = None,
    robots: Annotated[int | None, typer.Option(help="Use a team of robots 1..N instead of the scenario's.")] = None,
    show: Annotated[bool, typer.Option("--show", help="Print all of it, with the course as drawn.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print all of it as JSON.")] = False,
) -> int:
    if is_fleet_file(Path(scenario)):
        if overrides or robots is not None:
            raise Refused(f"{scenario}: --set and --robots are for a scenario: a fleet file has the keys set and team")
        return _fleet(Path(scenario), show=show, as_json=as_json)
    if is_file(scenario):
        GENERATORS.add_file(scenario)
    drawn = draw(load_scenario(scenario, overrides or (), robots), seed)
    if as_json:
        print_visible(msgspec.json.encode(drawn).decode())
    elif show:
        print_visible(toml(drawn), end="")
    else:
        print_visible(f"{scenario}: ok, {len(drawn.mission.robots)} robots, at most {drawn.time_limit_s:g} s")
    return 0


def _fleet(path: Path, *, show: bool, as_json: bool) -> int:
    """Print a fleet, or that it is right. Raises RefusedFile with all mistakes."""
    plan = load(path)
    if as_json:
        print_visible(msgspec.json.encode(plan.file).decode())
        return 0
    if not show:
        machines = f"{len(plan.hosts)} machine{'s' if len(plan.hosts) > 1 else ''}"
        print_visible(f"{path}: ok, fleet {plan.name} of {len(plan.places)} robots on {machines}")
        return 0
    print_visible(
        f"fleet {plan.name}: {plan.file.scenario}, world on {plan.file.world}, witness on {plan.file.witness}"
    )
    for name, machine in plan.hosts.items():
        robots = " ".join(map(robot_name, plan.robots_on(name))) or "no robot"
        print_visible(f"host {name} ({machine.ssh or machine.address}): {robots}")
    return 0
