"""What `lfa run` and `lfa sim` are both asked: one place for each option's type and help."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

ScenarioName = Annotated[str, typer.Argument(help="A shipped scenario (lfa list) or a .toml file.")]
Seed = Annotated[int | None, typer.Option(help="Draws noise, places, starts, delays and losses. Default 0.")]
Overrides = Annotated[list[str] | None, typer.Option("--set", help="Any field: world.lidar.beams=90.")]
Robots = Annotated[int | None, typer.Option(help="A team of 1..N instead of the scenario's.")]
Faults = Annotated[list[str] | None, typer.Option(help="Such as 'kill leader at 20 s'; again for more.")]
Out = Annotated[Path | None, typer.Option(help="Run folder; default runs/<scenario>-<time>.")]
MapFrom = Annotated[
    Path | None, typer.Option(help="An earlier run's folder: the same world, its obstacles known (iteration 2).")
]
Figures = Annotated[bool, typer.Option(help="Draw figures/*.png.")]
JUnit = Annotated[Path | None, typer.Option(help="Write the assertions' results as JUnit XML.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the summary as JSON.")]
