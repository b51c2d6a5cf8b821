"""`lfa stop`: every robot stands, now, until `lfa resume`; says who has not stopped."""

from __future__ import annotations

from pathlib import Path

import msgspec

from lfa.deploy.client.session import find, listen
from lfa.deploy.client.stop_fleet import TOPICS, outcome_lines, stop_fleet
from lfa.deploy.operate.options import AsJson, Connect, FleetName, Keys
from lfa.deploy.terminal_text import print_visible


def command(
    fleet: FleetName = None,
    connect: Connect = None,
    keys: Keys = None,
    as_json: AsJson = False,
) -> int:
    """Stop every robot at its gateway; return 0 if all stand, 1 if some have not answered. Raises Refused."""
    return say(fleet, connect, keys, as_json, stand=True)


def say(fleet: str | None, connect: str | None, keys: Path | None, as_json: bool, *, stand: bool) -> int:
    """Say stop or resume to a fleet, print what became of it, and return the exit code. Raises Refused."""
    with listen(find(fleet, connect, keys), TOPICS) as subscriber:
        outcome = stop_fleet(subscriber, stand=stand)
    if as_json:
        print_visible(msgspec.json.encode(outcome).decode())
    else:
        print_visible("\n".join(outcome_lines(outcome, stand=stand)))
    return 0 if outcome.complete else 1
