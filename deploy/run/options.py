"""Options shared by `lfa run` and `lfa sim`: type and help text of each."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

ScenarioName = Annotated[
    str, typer.Argument(help="A shipped scenario (lfa list), a .toml file, or a generator, FILE.py:Class.")
]
Seed = Annotated[int | None, typer.Option(help="Seed of all that is drawn; default the scenario's.")]
Overrides = Annotated[list[str] | None, typer.Option("--set", help="Override a field: world.lidar.beams=90.")]
Robots = Annotated[int | None, typer.Option(help="Number of robots N, ids 1..N, instead of the scenario's.")]
Faults = Annotated[list[str] | None, typer.Option(help="Inject a fault: 'kill leader at 20 s'. Repeatable.")]
Out = Annotated[Path | None, typer.Option(help="Run folder; default runs/<scenario>-<time>.")]
MapFrom = Annotated[
    Path | None, typer.Option(help="Folder of an earlier run: same world, known obstacles (iteration 2).")
]
Figures = Annotated[bool, typer.Option(help="Draw figures/*.png; later: lfa plot RUN.")]
Record = Annotated[
    Literal["full", "summary", "none"],
    typer.Option(help="Keep the whole run folder, only its summary and events, or nothing."),
]
Verbose = Annotated[bool, typer.Option("-v", "--verbose", help="Show terms as in messages, not counted in the run.")]
JUnit = Annotated[Path | None, typer.Option(help="Write the assertions' results as JUnit XML.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the summary as JSON.")]
