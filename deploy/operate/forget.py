"""`lfa forget`: declare robots permanently lost, so that a fleet without its config need not wait for them (E20)."""

from __future__ import annotations

from typing import Annotated

import msgspec
import typer

from lfa.deploy.client.operator import Operator
from lfa.deploy.client.session import Subscriber, find, listen
from lfa.deploy.operate.options import AsJson, Connect, FleetName, Keys
from lfa.deploy.terminal_text import print_visible
from lfa.protocol import clock, incarnations
from lfa.protocol.errors import Refused
from lfa.protocol.messages.consensus import Role
from lfa.protocol.messages.team import Event, MissionNote, PoseStamped, Status
from lfa.protocol.names import robot_id_of, robot_name
from lfa.protocol.transport.message_bus import send

LISTEN_S = 1.2
"""Time [s] to listen, long enough to receive a leader's pose and each robot's status."""
ANSWER_S_MAX = 6.0
"""Longest time [s] to wait for a leader: two attempts of the slowest profile."""


def command(
    robots: Annotated[list[int], typer.Argument(help="Ids of dead robots; they must stay off until this is done.")],
    fleet: FleetName = None,
    connect: Connect = None,
    keys: Keys = None,
    as_json: AsJson = False,
) -> int:
    """Declare robots permanently lost and wait for a leader; return 0 if one leads, else 1. Raises Refused."""
    for robot in robots:
        if robot < 1:
            raise Refused(f"id {robot}: must be a robot's, from 1 upwards")
    with listen(find(fleet, connect, keys), frozenset({"*/event", "*/pose", "*/status", "*/mission"})) as subscriber:
        send(subscriber.bus, Operator(subscriber.fleet.name, incarnations.drawn()).ask("mission", clock.now()))
        leader, _, team = _listen(subscriber, LISTEN_S)
        for robot in robots:
            if team and robot not in team:
                raise Refused(f"id {robot}: must be one of the fleet's robots {', '.join(map(str, team))}")
            if subscriber.is_alive(robot_name(robot)):
                raise Refused(f"robot {robot} lives: end its process first, or let it join")
        asked = leader is None
        waits = ""
        if asked:
            _say(subscriber, robots)
            leader, waits, _ = _listen(subscriber, ANSWER_S_MAX, until_led=True)
    if as_json:
        print_visible(msgspec.json.encode({"robots": robots, "asked": asked, "leader": leader}).decode())
    elif not asked:
        print_visible(f"robot{leader} leads: who is silent leaves its voters without being forgotten")
    elif leader is None:
        print_visible(f"nobody leads after {ANSWER_S_MAX:g} s{waits}")
    else:
        print_visible(f"forgotten: {', '.join(map(robot_name, robots))}; robot{leader} leads")
    return 0 if leader is not None else 1


def _say(subscriber: Subscriber, robots: list[int]) -> None:
    """Publish the command; it covers every incarnation started before this moment, a later one may join."""
    number = incarnations.drawn()
    operator = Operator(subscriber.fleet.name, number)
    ended = [[robot, number] for robot in robots]
    send(subscriber.bus, operator.command("forget", clock.now(), lives=ended))


def _listen(subscriber: Subscriber, seconds: float, until_led: bool = False) -> tuple[int | None, str, tuple[int, ...]]:
    """Return the leader, the status of a robot that waits for others, and the mission's robots, as far as received.

    With `until_led`, return as soon as a robot leads.
    """
    leader: int | None = None
    waits, team = "", tuple[int, ...]()
    until = clock.now() + seconds
    while clock.now() < until and not (until_led and leader is not None):
        subscriber.wait(0.05)
        for _, message in subscriber.take():
            match message:
                case PoseStamped(role=Role.LEADER) | Event(kind="lease", data={"change": "acquired"}):
                    leader = robot_id_of(message.header.sender)
                case Event(kind="lease"):
                    leader = None
                case Status(text=text) if text.startswith("waiting for"):
                    waits = f": {message.header.sender} is {text}"
                case MissionNote(mission=mission):
                    team = mission.robots
    return leader, waits, team
