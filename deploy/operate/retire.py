"""`lfa retire`: takes a robot out of a running team: the rest close up, and a leader hands over first."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lfa.agents.orders.roster_orders import RETIRE
from lfa.deploy.operate import join


def command(
    robot: Annotated[int, typer.Argument(help="Id of the robot; it stands from then on, until it joins again.")],
    fleet: Annotated[str | None, typer.Option(help="Name of the fleet, if several run here.")] = None,
    connect: Annotated[str | None, typer.Option(help="Router, if not the fleet's own on this machine.")] = None,
    keys: Annotated[Path | None, typer.Option(help="Key folder from `lfa keys`, for a secured fleet.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the outcome as JSON.")] = False,
) -> int:
    """Retire a robot of the team; return 0 if quorums have accepted it, else 1. Raises Refused."""
    return join.say(RETIRE, robot, 0, fleet, connect, keys, as_json)
