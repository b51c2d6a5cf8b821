"""`lfa validate`: a scenario is read, checked and drawn, and nothing is started."""

from __future__ import annotations

from typing import Annotated

import msgspec
import typer

from deploy.run.chosen import choose
from deploy.run.faults import parse_all
from deploy.run.folder import toml
from world.scenario import draw


def command(
    scenario: Annotated[str, typer.Argument(help="A shipped scenario (lfa list) or a .toml file.")],
    seed: Annotated[int, typer.Option(help="Show what this seed makes of it.")] = 0,
    overrides: Annotated[list[str] | None, typer.Option("--set", help="Any field: world.lidar.beams=90.")] = None,
    robots: Annotated[int | None, typer.Option(help="A team of 1..N instead of the scenario's.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print as JSON instead of TOML.")] = False,
) -> int:
    chosen = choose(scenario, overrides or (), robots)
    parse_all(chosen.mission, chosen.faults, ())
    drawn = draw(chosen, seed)
    print(msgspec.json.encode(drawn).decode() if as_json else toml(drawn), end="\n" if as_json else "")
    return 0
