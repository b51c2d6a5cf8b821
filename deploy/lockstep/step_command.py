"""`lfa step`: lets a lockstep run that stands go on, by some ticks or without an end."""

from __future__ import annotations

from typing import Annotated

import msgspec
import typer

from lfa.deploy.client.operator import Operator
from lfa.deploy.client.session import Subscriber, find, listen
from lfa.deploy.lockstep.stepping import STEP, STEPPED, ticks_of
from lfa.deploy.terminal_text import print_visible
from lfa.protocol import clock, incarnations
from lfa.protocol.errors import Refused
from lfa.protocol.messages.team import Event
from lfa.protocol.transport.message_bus import send

ANSWER_S_MAX = 30.0
WAIT_S = 0.1


def command(
    ticks: Annotated[
        str | None, typer.Argument(help="Number of ticks (control periods) to go on by; default: without an end.")
    ] = None,
    fleet: Annotated[str | None, typer.Option(help="Name of the fleet, if several run here.")] = None,
    connect: Annotated[str | None, typer.Option(help="Router, if several lockstep runs are on this machine.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print where the run stands as JSON.")] = False,
) -> int:
    """Let a standing lockstep run go on; return 0 once it has, 1 if no run that stands has answered. Raises Refused."""
    number = 0 if ticks is None else ticks_of("ticks", ticks)
    with listen(find(fleet, connect), frozenset({"operator/event"})) as subscriber:
        own_number = incarnations.drawn()
        operator = Operator(subscriber.fleet.name, own_number)
        send(subscriber.bus, operator.command(STEP, clock.now(), ticks=number))
        event = _answer(subscriber, own_number)
    if event is None:
        print_visible("no lockstep run that stands has answered: start one with lfa run SCENARIO --lockstep --pause")
        return 1
    facts = {"what": event.data["what"], "tick": event.data["tick"], "time_s": event.header.stamp}
    at = f"tick {facts['tick']} ({event.header.stamp:.3f} s)"
    print_visible(
        msgspec.json.encode(facts).decode() if as_json else f"{facts['what']} {'at' if number else 'from'} {at}"
    )
    return 0


def _answer(subscriber: Subscriber, own_number: int) -> Event | None:
    """Return the event that answers the operator of this number: where the run stands, or from where it goes on.

    None if none comes. Raises Refused for a fleet in real time, whose processes have tokens: in lockstep none has one.
    """
    until = clock.now() + ANSWER_S_MAX
    while clock.now() < until:
        for _, message in subscriber.take():
            if isinstance(message, Event) and message.kind == STEPPED and message.data.get("asked") == own_number:
                return message
        if subscriber.living:
            stands = "only a run of lfa run SCENARIO --lockstep goes by ticks"
            raise Refused(f"fleet {subscriber.fleet.name} runs in real time: {stands}")
        subscriber.wait(WAIT_S)
    return None
