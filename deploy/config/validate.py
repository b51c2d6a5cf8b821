"""`lfa validate`: a scenario is read, checked and drawn; of a fleet file every mistake is said; nothing starts."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import msgspec
import typer

from lfa.deploy.faults.script import parse_all
from lfa.deploy.fleet.plan.fleet_file import is_fleet_file, load
from lfa.deploy.recording.run_folder import toml
from lfa.deploy.scenario_loading import load_scenario
from lfa.protocol.errors import Refused
from lfa.protocol.names import robot_name
from lfa.world.description.load import draw


def command(
    scenario: Annotated[str, typer.Argument(help="A shipped scenario (lfa list), a scenario's or a fleet's .toml.")],
    seed: Annotated[int, typer.Option(help="Show what this seed makes of it.")] = 0,
    overrides: Annotated[list[str] | None, typer.Option("--set", help="Any field: world.lidar.beams=90.")] = None,
    robots: Annotated[int | None, typer.Option(help="A team of 1..N instead of the scenario's.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print as JSON instead of TOML.")] = False,
) -> int:
    if is_fleet_file(Path(scenario)):
        if overrides or robots is not None:
            raise Refused(f"{scenario}: --set and --robots are for a scenario: a fleet file has the keys set and team")
        return _fleet(Path(scenario), as_json=as_json)
    chosen = load_scenario(scenario, overrides or (), robots)
    parse_all(chosen.mission, chosen.faults, ())
    drawn = draw(chosen, seed)
    print(msgspec.json.encode(drawn).decode() if as_json else toml(drawn), end="\n" if as_json else "")
    return 0


def _fleet(path: Path, *, as_json: bool) -> int:
    """What runs where. Raises Refused with a line a mistake."""
    plan = load(path)
    if as_json:
        print(msgspec.json.encode(plan.file).decode())
        return 0
    print(f"fleet {plan.name}: {plan.file.scenario}, world on {plan.file.world}, witness on {plan.file.witness}")
    for name, machine in plan.hosts.items():
        robots = " ".join(map(robot_name, plan.robots_on(name))) or "no robot"
        print(f"host {name} ({machine.ssh or machine.address}): {robots}")
    return 0
