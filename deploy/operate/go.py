"""`lfa go`: sends a running fleet to another goal, along another route, or on after a pause."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lfa.deploy.client.mission_changes import Points, along, to_goal, unchanged
from lfa.deploy.client.order_fleet import walls_of
from lfa.deploy.operate import pause
from lfa.deploy.operate.options import AsJson, Connect, FleetName, Keys
from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import DamagedFile, read_text

ROUTE_POINTS_MAX = 1000


def command(
    x: Annotated[float | None, typer.Argument(help="Goal x [m] in map; without a goal, a pause ends.")] = None,
    y: Annotated[float | None, typer.Argument(help="Goal y [m] in map.")] = None,
    theta: Annotated[float | None, typer.Argument(help="Heading [degrees] in which to arrive.")] = None,
    route: Annotated[Path | None, typer.Option(help="File with a way-point `x y` [m] on each line.")] = None,
    fleet: FleetName = None,
    connect: Connect = None,
    keys: Keys = None,
    as_json: AsJson = False,
) -> int:
    """Change the team's goal; return 0 if a leader has acknowledged it, else 1. Raises Refused."""
    points = _points(x, y, theta, route)
    if points is None:
        return pause.say("go", lambda subscriber: unchanged, fleet, connect, keys, as_json, paused=False)
    return pause.say(
        "go", lambda subscriber: along(points, walls_of(subscriber)), fleet, connect, keys, as_json, paused=False
    )


def _points(x: float | None, y: float | None, theta: float | None, route: Path | None) -> Points | None:
    """Return the way-points asked for, or None for none. Raises Refused."""
    if route is not None:
        if x is not None:
            raise Refused("go: must be a goal or --route, not both")
        return points_in(route)
    if x is None:
        return None
    if y is None:
        raise Refused(f"go {x:g}: must be X Y, or X Y THETA")
    return to_goal(x, y, theta)


def points_in(path: Path) -> Points:
    """Return the way-points in a file. Raises Refused that names the line."""
    try:
        lines = read_text(path).splitlines()
    except (OSError, DamagedFile) as error:
        raise Refused(f"--route {path}: cannot be read ({getattr(error, 'strerror', None) or error})") from None
    points: Points = ()
    for number, line in enumerate(lines, start=1):
        words = line.partition("#")[0].replace(",", " ").split()
        if not words:
            continue
        try:
            x, y = map(float, words)
            points += to_goal(x, y, None)
        except ValueError:  # a Refused is one too
            raise Refused(f"{path}:{number}: {line.strip()!r}: must be a way-point x y [m]") from None
    if not 1 <= len(points) <= ROUTE_POINTS_MAX:
        raise Refused(f"--route {path}: {len(points)} way-points, must be 1 to {ROUTE_POINTS_MAX}")
    return points
