"""`lfa map`: export a robot's map of explored ground as a ROS map.yaml and its pgm.

The map is not recorded: the robot's journal is re-executed, and the map is read from its agent at the end.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from lfa.agents.agent import Agent
from lfa.agents.exploration.occupancy_grid import CELL_M, OCCUPIED, Grid
from lfa.deploy.analysis.verification import reexecution
from lfa.deploy.recording import event_log
from lfa.deploy.recording.run_folder import JOURNALS
from lfa.deploy.terminal_text import print_visible
from lfa.deploy.whole_output import whole_folder
from lfa.protocol.errors import Refused
from lfa.protocol.names import robot_name
from lfa.protocol.runtime import journal
from lfa.protocol.runtime.journal import Journal
from lfa.protocol.runtime.node_host import NodeHost
from lfa.world.description import maps
from lfa.world.description.maps import Map

RIM_CELLS = 2
"""Width [cells] of the border of unknown ground around the known part of a map."""


def command(
    run: Annotated[Path, typer.Argument(help="Run folder of a scenario with motion = explore.")],
    out: Annotated[Path | None, typer.Option(help="Folder for map.yaml and map.pgm; default the run folder.")] = None,
    robot: Annotated[int | None, typer.Option(help="Id of the robot; default the last leader.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print path and size of the map as JSON.")] = False,
) -> int:
    drawn = map_of(run, robot)
    path = (out or run) / "map.yaml"
    try:
        with whole_folder(path.parent) as fresh:
            maps.write(fresh / path.name, drawn)
    except OSError as error:
        raise Refused(f"--out {path.parent}: cannot be written ({error.strerror}), give a place to write to") from None
    rows, columns = drawn.cells.shape
    facts = {"map": str(path), "columns": columns, "rows": rows, "resolution_m": drawn.resolution_m,
             "known_cells": int((drawn.cells >= 0).sum()), "occupied_cells": int(drawn.occupied.sum())}  # fmt: skip
    print_visible(
        json.dumps(facts) if as_json else f"{path}: {columns} x {rows} cells, {facts['occupied_cells']} occupied"
    )
    return 0


def _incarnation(path: Path) -> int:
    """Return the incarnation in the name of a journal, 0 for a name that no process gives."""
    number = path.stem.split("-")[1]
    return int(number) if number.isascii() and number.isdecimal() else 0


def map_of(run: Path, robot: int | None = None) -> Map:
    """Return the map of `robot`, by default of the last leader, at the end of the run.

    Raises Refused when the robot has no journal or kept no map.
    """
    leader_terms = event_log.leader_terms(event_log.lines(run))
    robot = robot if robot is not None else leader_terms[-1].robot_id if leader_terms else 1
    paths = sorted((run / JOURNALS).glob(f"{robot_name(robot)}-*.bin"), key=_incarnation)
    if not paths:
        raise Refused(f"{run}: no journal of {robot_name(robot)}: must be a run folder with that robot in it")
    try:
        heading, entries = journal.read(paths[-1])
    except (OSError, ValueError) as error:
        raise Refused(f"{paths[-1]}: cannot be read ({error})") from None
    node = reexecution.node_of(paths[-1], heading)
    host = NodeHost(node, Journal(None, heading))
    for entry in entries:
        reexecution.call(host, entry)
    grid = node.grid if isinstance(node, Agent) else None
    if grid is None:
        raise Refused(f"{run}: {robot_name(robot)} kept no map: must be a run with mission.leading.motion = explore")
    return known_part(grid)


def known_part(grid: Grid) -> Map:
    """Return the smallest map with all known cells of `grid`, and a border of `RIM_CELLS`."""
    scores = np.frombuffer(bytes(grid.scores), dtype=np.uint8).reshape(grid.rows, grid.columns)
    cells = np.where(scores >= OCCUPIED, maps.OCCUPIED, np.where(scores > 0, 0, maps.UNKNOWN)).astype(np.int16)
    rows, columns = np.nonzero(scores)
    if not len(rows):
        return Map(cells, CELL_M, (grid.x0_m, grid.y0_m, 0.0))
    low = max(0, int(rows.min()) - RIM_CELLS), max(0, int(columns.min()) - RIM_CELLS)
    part = cells[low[0] : int(rows.max()) + RIM_CELLS + 1, low[1] : int(columns.max()) + RIM_CELLS + 1]
    return Map(part, CELL_M, (grid.x0_m + low[1] * CELL_M, grid.y0_m + low[0] * CELL_M, 0.0))
