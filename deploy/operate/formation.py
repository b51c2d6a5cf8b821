"""`lfa formation`: ask the leader for another formation, and wait for its acknowledgement."""

from __future__ import annotations

from typing import Annotated

import msgspec
import typer

from lfa.agents.formation.formation import named
from lfa.deploy.client.operator import Operator
from lfa.deploy.client.session import Subscriber, find, listen
from lfa.deploy.operate.options import Connect, FleetName, Keys
from lfa.deploy.terminal_text import print_visible
from lfa.protocol import clock, incarnations
from lfa.protocol.messages.team import Event
from lfa.protocol.mission import FormationSpec
from lfa.protocol.transport.message_bus import send

ANSWER_S_MAX = 2.0
JOINED_S = 0.2  # time [s] until a newly declared subscription receives messages


def command(
    side: Annotated[str, typer.Argument(help="left, right, column or zigzag.")],
    fleet: FleetName = None,
    connect: Connect = None,
    keys: Keys = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the leader's answer as JSON.")] = False,
) -> int:
    """Ask the leader for the formation `side`; return 0 if it acknowledged, else 1. Raises Refused."""
    named(side, FormationSpec())
    with listen(find(fleet, connect, keys), frozenset({"*/event"})) as subscriber:
        clock.sleep(JOINED_S)
        answer = ask(subscriber, side)
        if answer is None:
            subscriber.refuse_absent(f"formation {side}")
    if as_json:
        facts = {"side": side, "acknowledged": answer is not None}
        print_visible(
            msgspec.json.encode(facts if answer is None else {**facts, "leader": answer.header.sender}).decode()
        )
    elif answer is None:
        print_visible(f"formation {side}: no leader answered within {ANSWER_S_MAX:g} s")
    else:
        print_visible(
            f"formation {side}: ordered by {answer.header.sender}, request {answer.data.get('number')} of its term"
        )
    return 0 if answer is not None else 1


def ask(subscriber: Subscriber, side: str) -> Event | None:
    """Send the request to the fleet; return the leader's acknowledging event, or None if none comes in time."""
    say(subscriber, side)
    until = clock.now() + ANSWER_S_MAX
    while clock.now() < until:
        subscriber.wait(0.05)
        for _, message in subscriber.take():
            if isinstance(message, Event) and message.kind == "formation" and message.data.get("by") == "operator":
                return message
    return None


def say(subscriber: Subscriber, side: str) -> None:
    operator = Operator(subscriber.fleet.name, incarnations.drawn())
    send(subscriber.bus, operator.command("formation", clock.now(), side=side))
