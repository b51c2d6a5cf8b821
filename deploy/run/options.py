"""Options shared by `lfa run` and `lfa sim`: type and help text of each."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

ScenarioName = Annotated[str, typer.Argument(help="A shipped scenario (lfa list) or a .toml file.")]
Seed = Annotated[int | None, typer.Option(help="Seed of noise, places, starts, delays and losses; default 0.")]
Overrides = Annotated[list[str] | None, typer.Option("--set", help="Override a field: world.lidar.beams=90.")]
Controller = Annotated[
    str | None, typer.Option(help="Controller of the followers: an installed one by name, or yours: FILE.py:Class.")
]
Robots = Annotated[int | None, typer.Option(help="Number of robots N, ids 1..N, instead of the scenario's.")]
Faults = Annotated[list[str] | None, typer.Option(help="Inject a fault: 'kill leader at 20 s'. Repeatable.")]
Out = Annotated[Path | None, typer.Option(help="Run folder; default runs/<scenario>-<time>.")]
MapFrom = Annotated[
    Path | None, typer.Option(help="Folder of an earlier run: same world, known obstacles (iteration 2).")
]
Figures = Annotated[bool, typer.Option(help="Draw figures/*.png.")]
JUnit = Annotated[Path | None, typer.Option(help="Write the assertions' results as JUnit XML.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the summary as JSON.")]
