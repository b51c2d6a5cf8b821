"""`lfa retire`: takes a robot out of a running team: the rest close up, and a leader hands over first."""

from __future__ import annotations

from typing import Annotated

import typer

from lfa.agents.orders.roster_orders import RETIRE
from lfa.deploy.operate import join
from lfa.deploy.operate.options import AsJson, Connect, FleetName, Keys


def command(
    robot: Annotated[int, typer.Argument(help="Id of the robot; it stands from then on, until it joins again.")],
    fleet: FleetName = None,
    connect: Connect = None,
    keys: Keys = None,
    as_json: AsJson = False,
) -> int:
    """Retire a robot of the team; return 0 if quorums have accepted it, else 1. Raises Refused."""
    return join.say(RETIRE, robot, 0, fleet, connect, keys, as_json)
