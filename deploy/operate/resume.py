"""`lfa resume`: lifts a stop, so that the fleet goes on with what it was doing."""

from __future__ import annotations

from lfa.deploy.operate import stop
from lfa.deploy.operate.options import AsJson, Connect, FleetName, Keys


def command(
    fleet: FleetName = None,
    connect: Connect = None,
    keys: Keys = None,
    as_json: AsJson = False,
) -> int:
    """Lift the stop; return 0 if every robot may go, 1 if some have not answered. Raises Refused if none is stopped."""
    return stop.say(fleet, connect, keys, as_json, stand=False)
