"""`lfa pause`: the leader stands, and its team with it, until `lfa go`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import msgspec

from lfa.deploy.client.mission_changes import unchanged
from lfa.deploy.client.order_call import Change
from lfa.deploy.client.order_fleet import TOPICS, order_fleet
from lfa.deploy.client.session import Subscriber, find, listen
from lfa.deploy.operate.options import AsJson, Connect, FleetName, Keys
from lfa.deploy.terminal_text import print_visible
from lfa.protocol.errors import Refused


def command(
    fleet: FleetName = None,
    connect: Connect = None,
    keys: Keys = None,
    as_json: AsJson = False,
) -> int:
    """Pause the team; return 0 if a leader has acknowledged it, else 1. Raises Refused."""
    return say("pause", lambda subscriber: unchanged, fleet, connect, keys, as_json, paused=True)


def say(
    what: str,
    make: Callable[[Subscriber], Change],
    fleet: str | None,
    connect: str | None,
    keys: Path | None,
    as_json: bool,
    *,
    paused: bool | None = None,
) -> int:
    """Change a fleet's mission as `make` says, print what became of it, and return the exit code. Raises Refused."""
    with listen(find(fleet, connect, keys), TOPICS) as subscriber:
        outcome = order_fleet(subscriber, make(subscriber), paused=paused)
        if outcome.leader is None:
            subscriber.refuse_absent(what)
    if outcome.reason:
        raise Refused(f"{what}: robot{outcome.leader} refuses it: {outcome.reason}")
    if as_json:
        print_visible(msgspec.json.encode(outcome).decode())
    elif outcome.leader is None:
        print_visible(f"{what}: no leader has answered")
    else:
        known = f"{len(outcome.robots)} robots know it"
        print_visible(f"{what}: order {outcome.version} carried out by robot{outcome.leader}, {known}")
    return 0 if outcome.leader is not None else 1
