"""Changes of a running fleet's team over a session."""

from __future__ import annotations

from lfa.agents.orders.roster_orders import QUESTION
from lfa.deploy.client.operator import Operator
from lfa.deploy.client.roster.roster_call import RosterCall, RosterOutcome
from lfa.deploy.client.session import Subscriber
from lfa.protocol import clock, incarnations
from lfa.protocol.messages.team import Event
from lfa.protocol.transport.message_bus import send

TOPICS = frozenset({"*/event"})
"""Topics that a session must hear for `change_roster`."""


def change_roster(ear: Subscriber, command: str, robot: int, slot_of: int = 0) -> RosterOutcome:
    """Let a robot join the fleet of `ear`, or retire it. Raises Refused for a change that cannot be."""
    operator = Operator(ear.fleet.name, incarnations.drawn())
    call = RosterCall(command, robot, slot_of, clock.now())
    while True:
        now = clock.now()
        if call.due(now):
            asked = operator.ask(QUESTION, now)
            send(ear.bus, asked if call.asks else operator.command(command, now, **call.arguments))
        for _, message in ear.take():
            if isinstance(message, Event):
                call.hear(message, clock.now())
        outcome = call.outcome(clock.now())
        if outcome is not None:
            return outcome
        ear.wait(0.02)
