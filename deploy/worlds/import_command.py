"""`lfa import`: a world of another program as a scenario, with a way through it and a team on that."""

from __future__ import annotations

import json
import os
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from lfa.deploy.scenario_loading import load_scenario
from lfa.deploy.terminal_text import print_visible
from lfa.deploy.worlds.drawing import WorldDrawing, numbers, text_of
from lfa.deploy.worlds.fitting import scenario_text
from lfa.deploy.worlds.irsim import loaded, read_irsim
from lfa.deploy.worlds.movingai import add_cells, read_movingai
from lfa.deploy.worlds.sdf import read_sdf
from lfa.deploy.worlds.svg import read_svg
from lfa.deploy.worlds.xml_tree import parsed
from lfa.protocol.errors import Refused
from lfa.world.description import maps
from lfa.world.description.scenario import Point

FORMATS = ".yaml (IR-SIM, or a ROS map), .map (MovingAI), .sdf or .world (SDF), .svg"
CELL_M = 0.5
"""Width [m] of a cell of a MovingAI map: room for a robot and its neighbour's slot."""
UNIT_M_MAX = 100.0
SHOWN_MAX = 5


def command(
    file: Annotated[Path, typer.Argument(help=f"World to read: {FORMATS}.")],
    out: Annotated[Path | None, typer.Option(help="Scenario to write; default NAME.toml here.")] = None,
    robots: Annotated[int | None, typer.Option(help="Number of robots; default the file's, or 4.")] = None,
    start: Annotated[str | None, typer.Option(help="Start X,Y [m] of the last robot of the column.")] = None,
    goal: Annotated[str | None, typer.Option(help="Goal X,Y [m] of the first.")] = None,
    unit_m: Annotated[
        float | None, typer.Option("--unit-m", help="Length [m] of a .map's cell or an .svg's unit.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was read as JSON.")] = False,
) -> int:
    """Read a world, write a scenario that `lfa validate` accepts, and say what was left out. Raises Refused."""
    if robots is not None and not 1 <= robots <= 500:
        raise Refused(f"--robots {robots}: must be from 1 to 500")
    if unit_m is not None and not 0.0 < unit_m <= UNIT_M_MAX:
        raise Refused(f"--unit-m {unit_m:g}: must be above 0 and at most {UNIT_M_MAX:g}")
    places = (_point("--start", start), _point("--goal", goal))
    path = out or Path(f"{file.stem}.toml")
    if path.exists():
        raise Refused(f"{path}: exists already, give another place with --out")
    drawing = None
    try:
        drawing = read_world(file, unit_m)
        text = scenario_text(drawing, robots, *places)
    except Refused as refused:
        said = str(refused)
        if drawing is not None and drawing.skipped and not (drawing.walls or drawing.obstacles):
            said += f" (left out: {', '.join(drawing.skipped[:SHOWN_MAX])})"
        raise Refused(said if said.startswith(str(file)) else f"{file}: {said}") from None
    _write(path, text, file)
    counts = {"walls": len(drawing.walls), "obstacles": len(drawing.obstacles)}
    if as_json:
        print_visible(json.dumps({"scenario": str(path), **counts, "skipped": drawing.skipped}))
        return 0
    print_visible(f"{path}: {counts['walls']} walls, {counts['obstacles']} obstacles; next: lfa sim {path}")
    for skipped in drawing.skipped[:SHOWN_MAX]:
        print_visible(f"left out: {skipped}")
    if len(drawing.skipped) > SHOWN_MAX:
        print_visible(f"left out: {len(drawing.skipped) - SHOWN_MAX} more, see --json")
    return 0


def read_world(file: Path, unit_m: float | None = None) -> WorldDrawing:
    """Return what stands in a world's file, by the format that its name says. Raises Refused."""
    drawing = WorldDrawing(file.stem)
    match file.suffix.lower():
        case ".map":
            read_movingai(text_of(file), drawing, unit_m or CELL_M)
        case ".sdf" | ".world":
            read_sdf(parsed(text_of(file)), drawing, file)
        case ".svg":
            read_svg(parsed(text_of(file)), drawing, unit_m)
        case ".yaml" | ".yml":
            document = loaded(text_of(file))
            if "image" in document:
                add_cells(maps.read(file), drawing)
            else:
                read_irsim(document, drawing)
        case other:
            raise Refused(f"{other or 'a name without an ending'}: must be one of {FORMATS}")
    return drawing


def _point(option: str, text: str | None) -> Point | None:
    if text is None:
        return None
    values = numbers(text, option)
    if len(values) != 2:
        raise Refused(f"{option} {text[:40]}: must be X,Y in metres")
    return values[0], values[1]


def _write(path: Path, text: str, source: Path) -> None:
    """Write the scenario in one step, once it is known to be accepted. Raises Refused."""
    try:
        handle, name = tempfile.mkstemp(suffix=".toml", dir=path.parent)
        written = Path(name)
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                file.write(text)
            load_scenario(name)
            written.chmod(0o644)
            written.replace(path)
        finally:
            written.unlink(missing_ok=True)
    except OSError as error:
        raise Refused(f"{path}: cannot be written ({error.strerror})") from None
    except Refused as refused:
        said = str(refused).splitlines()[0].replace(name, "the scenario of it")
        raise Refused(f"{source}: {said}") from None
