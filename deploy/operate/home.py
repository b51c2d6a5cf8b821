"""`lfa home`: sends a running fleet back to its mission's first way-point."""

from __future__ import annotations

from lfa.deploy.client.mission_changes import along
from lfa.deploy.client.order_call import Change
from lfa.deploy.client.order_fleet import walls_of
from lfa.deploy.client.session import Subscriber
from lfa.deploy.operate import pause
from lfa.deploy.operate.options import AsJson, Connect, FleetName, Keys
from lfa.protocol.mission import Mission


def command(
    fleet: FleetName = None,
    connect: Connect = None,
    keys: Keys = None,
    as_json: AsJson = False,
) -> int:
    """Send the team to the mission's first way-point; return 0 if a leader has acknowledged it, else 1."""

    def homewards(subscriber: Subscriber) -> Change:
        walls = walls_of(subscriber)

        def change(mission: Mission, first: Mission) -> Mission:
            return along((first.leading.route_m[0],), walls)(mission, first)

        return change

    return pause.say("home", homewards, fleet, connect, keys, as_json, paused=False)
