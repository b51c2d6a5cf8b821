"""Changes of a running fleet's mission over a session, for the commands."""

from __future__ import annotations

from lfa.agents.orders.team_orders import QUESTION
from lfa.deploy.client.mission_changes import Walls
from lfa.deploy.client.operator import Operator
from lfa.deploy.client.order_call import Change, OrderCall, OrderOutcome
from lfa.deploy.client.session import Subscriber, scenario_of_fleet
from lfa.protocol import clock, incarnations
from lfa.protocol.messages.orders import OrderNote
from lfa.protocol.messages.team import Event, MissionNote
from lfa.protocol.transport.message_bus import send

TOPICS = frozenset({"*/team_order", "*/event", "*/mission"})
"""Topics that a session must hear for `order_fleet`."""
ASK_S = 0.2


def order_fleet(subscriber: Subscriber, change: Change, *, paused: bool | None = None) -> OrderOutcome:
    """Change the mission of `subscriber`'s fleet, and return who carries it out. Raises Refused for what does not fit.

    `paused`: whether the leader then stands; None: as before.
    """
    operator = Operator(subscriber.fleet.name, incarnations.drawn())
    call = OrderCall(change, paused, clock.now())
    ask_at = clock.now()
    while True:
        now = clock.now()
        order = call.said(now)
        if order is not None:
            send(subscriber.bus, operator.order(order, now))
        elif now >= ask_at:
            ask_at = now + ASK_S
            send(subscriber.bus, operator.ask("mission", now), operator.ask(QUESTION, now))
        for _, message in subscriber.take():
            match message:
                case MissionNote(mission=mission):
                    call.hear_mission(mission)
                case OrderNote() | Event():
                    call.hear(message)
        outcome = call.outcome(clock.now())
        if outcome is not None:
            return outcome
        subscriber.wait(0.02)


def walls_of(subscriber: Subscriber) -> Walls:
    """Return the walls [m] of the fleet's world, where its scenario is known on this machine."""
    scenario = scenario_of_fleet(subscriber.fleet)
    return () if scenario is None else scenario.world.walls_m
