"""`lfa fault`: inject a fault into a robot, the world, the router or the links of a fleet that runs on this machine.

It does not matter how the fleet was started. Processes are found in the process table by their options (`--id`,
`--fleet`, `--listen`); the signal goes only to exactly the process that was found: same pid, start time, user and
command line.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import msgspec
import typer

from lfa.deploy.client.discovery import DEFAULT_LISTEN, LISTEN_S, Running, agents, one_fleet, option, programs
from lfa.deploy.client.fleet_state import FleetState
from lfa.deploy.client.operator import Operator
from lfa.deploy.faults.link_faults import goal_of, note, order
from lfa.deploy.faults.script import COMMON, FAULT_ACTIONS, GOAL, LEADER, ORDERS, RESTART, SIGNALS
from lfa.deploy.operate import go
from lfa.deploy.operate.options import AsJson, FleetName
from lfa.deploy.process.identity import Identity, own_processes, send_signal
from lfa.deploy.terminal_text import print_visible
from lfa.protocol import clock, incarnations
from lfa.protocol.errors import Refused
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.team import Event
from lfa.protocol.names import robot_id_of, whole_number
from lfa.protocol.topics import OPERATOR_NAME, key
from lfa.protocol.transport.bus import Inbox
from lfa.protocol.transport.credentials import credentials
from lfa.protocol.transport.message_bus import Decoder, send
from lfa.protocol.transport.zenoh_bus import ZenohBus
from lfa.protocol.transport.zenoh_config import RouterAbsent

OBSTACLE = "obstacle"
RESTART_S_MAX, ORDER_EVERY_S = 2.0, 0.3  # time [s] to wait for a restart, and between two orders
SENT_S = 0.05  # delay [s] so that the event about a fault leaves before the fault


def command(
    action: Annotated[str, typer.Argument(help=f"One of: {', '.join(FAULT_ACTIONS)}.")],
    target: Annotated[
        str,
        typer.Argument(
            help="A robot's id, leader, world, router; for cut: 3, 1-2, 1,2-3,w or 1>2; for loss: a share; "
            "for obstacle: x,y,radius; for goal: x,y; for formation: a side."
        ),
    ] = "",
    more: Annotated[list[str] | None, typer.Argument(help="Nothing: a target is one word, as 3,1,0.4.")] = None,
    fleet: FleetName = None,
    as_json: AsJson = False,
) -> int:
    """Inject a fault into a fleet that runs on this machine. Raises Refused."""
    if action not in FAULT_ACTIONS:
        raise Refused(f"{action!r}: must be one of {', '.join(FAULT_ACTIONS)}")
    target = " ".join((target, *(more or ())))  # words where one belongs are refused as it is, with its form
    if action == OBSTACLE:
        order(action, target, ())  # a place that is none is refused before a fleet is looked for
    if action == GOAL:
        return go.command(*goal_of(target), fleet=fleet, as_json=as_json)
    team = one_fleet(agents(), fleet)
    inbox = Inbox()
    bus = _bus(team[0], inbox)
    if action in ORDERS:
        return _order(action, target, team, bus, inbox, as_json)
    if action == RESTART:
        return _restart(target, team[0].fleet, bus, inbox, as_json)
    try:
        whom, identity = _whom(target, team, bus, inbox)
        operator = Operator(team[0].fleet, incarnations.drawn())
        send(bus, operator.event("fault", clock.now(), deed=action, robot=whom))
        clock.sleep(SENT_S)
        done = send_signal(identity, SIGNALS[action])
    finally:
        bus.close()
    name = f"robot {whom}" if isinstance(whom, int) else whom
    if not done:
        raise Refused(f"{name}: its process {identity.pid} has gone in the meantime")
    facts = {"deed": action, "robot": whom, "fleet": team[0].fleet, "pid": identity.pid}
    said = f"{action} {name} of {team[0].fleet} (process {identity.pid}): {FAULT_ACTIONS[action]}"
    print_visible(msgspec.json.encode(facts).decode() if as_json else said)
    return 0


def _order(action: str, target: str, team: Sequence[Running], bus: ZenohBus, inbox: Inbox, as_json: bool) -> int:
    """Send an operator's message to all of the fleet. Raises Refused if it is invalid, or the fleet ignores faults."""
    fleet, robots = team[0].fleet, tuple(sorted(agent.robot for agent in team))
    try:
        if action in ("cut", "heal", "loss") and not all("--faults" in agent.identity.arguments for agent in team):
            without = ", ".join(str(agent.robot) for agent in team if "--faults" not in agent.identity.arguments)
            raise Refused(
                f"{action}: the links of a fleet are changed only where its processes allow it: start lfa-world "
                "and each lfa-agent by hand with --faults, or use lfa run; lfa up starts none so "
                f"(robots without: {without})"
            )
        whom = str(_victim(target, team, bus, inbox).robot) if target == LEADER else target
        operator = Operator(fleet, incarnations.drawn())
        said = note(operator, clock.now(), action, whom, robots)
        robot = whole_number(whom)
        event = operator.event("fault", clock.now(), deed=action, robot=whom if robot is None else robot)
        send(bus, event, said)
        clock.sleep(SENT_S)
    finally:
        bus.close()
    facts = {"deed": action, "target": whom, "fleet": fleet}
    line = f"{f'{action} {whom}'.strip()} in fleet {fleet}: {effect(action, whom)}"
    print_visible(msgspec.json.encode(facts).decode() if as_json else line)
    return 0


def effect(action: str, target: str) -> str:
    """Return in words what an order, found valid, does to its target, and what ends it."""
    match action:
        case "cut" if ">" in target:
            return "no radio from {} to {}, until lfa fault heal".format(*target.split(">"))
        case "cut":
            one, other = [*target.split("-"), "all others"][:2]
            return f"no radio between {one} and {other}, until lfa fault heal"
        case "heal":
            return f"the cut {target} is ended" if target else "all cuts and all loss are ended"
        case "loss" if target:
            return f"every receiver loses {100.0 * float(target):g} % of its messages, until lfa fault heal"
        case "loss":
            return "every receiver loses as many messages as at the start"
        case "range":
            reach_m = float(target)
            return f"messages reach robots {f'up to {reach_m:g} m away' if reach_m else 'at any distance'}"
        case _:
            return FAULT_ACTIONS[action]


def _restart(target: str, fleet: str, bus: ZenohBus, inbox: Inbox, as_json: bool) -> int:
    """Ask the fleet's launcher to restart a robot, and wait for its event. Raises Refused if none answers."""
    robot = robot_id_of(target if target.startswith("robot") else f"robot{target}")
    operator = Operator(fleet, incarnations.drawn())
    try:
        if robot is None:
            raise Refused(f"restart {target!r}: must be a robot's id, such as 3")
        bus.follow(frozenset({operator.event_key}))
        until, again = clock.now() + RESTART_S_MAX, 0.0
        while not any(_is_done(message, robot) for _, message in Decoder().messages(inbox.take())):
            now = clock.now()
            if now >= again:  # the launcher may not have noticed yet that the robot's last process is gone
                send(bus, operator.command(RESTART, now, robot=robot))
                again = now + ORDER_EVERY_S
            if now > until:
                raise Refused(
                    f"robot {robot} of {fleet}: runs already, or was started by hand: then start it again "
                    f"as before, lfa-agent --role follower --id {robot}, with the same options"
                )
            clock.sleep(SENT_S)
    finally:
        bus.close()
    facts = {"deed": RESTART, "robot": robot, "fleet": fleet}
    said = f"{RESTART} robot {robot} of {fleet}: {FAULT_ACTIONS[RESTART]}"
    print_visible(msgspec.json.encode(facts).decode() if as_json else said)
    return 0


def _is_done(message: Message, robot: int) -> bool:
    return isinstance(message, Event) and message.data == message.data | {"deed": RESTART, "robot": robot}


def _whom(target: str, team: Sequence[Running], bus: ZenohBus, inbox: Inbox) -> tuple[int | str, Identity]:
    """Return the robot, or world or router, that `target` names, and its process. Raises Refused."""
    if target not in COMMON:
        victim = _victim(target, team, bus, inbox)
        return victim.robot, victim.identity
    found = [identity for identity in own_processes() if _is_common(target, identity.arguments, team[0])]
    if not found:
        raise Refused(f"{target}: no such process of yours serves fleet {team[0].fleet} here")
    return target, found[0]


def _is_common(name: str, words: Sequence[str], agent: Running) -> bool:
    """Return True if a command line is that of the world, or of the router, of the agent's fleet."""
    called = programs(words)
    if name == "world":
        return bool(called & {"lfa.world.cli", "lfa-world"}) and option(words, "--fleet", "fleet") == agent.fleet
    listens = {word.removeprefix("--listen=") for word in words} if "--listen" in " ".join(words) else {*DEFAULT_LISTEN}
    return bool(called & {"lfa.deploy.fleet.host.router", "lfa-router"}) and agent.endpoint in listens


def _victim(target: str, team: Sequence[Running], bus: ZenohBus, inbox: Inbox) -> Running:
    leads = target == LEADER
    robot = _leader(team[0].fleet, bus, inbox) if leads else whole_number(target.removeprefix("robot"))
    if robot is None and leads:
        raise Refused(f"fleet {team[0].fleet} has no leader at the moment")
    victim = next((agent for agent in team if agent.robot == robot), None)
    if victim is None:
        ids = ", ".join(str(agent.robot) for agent in team)
        raise Refused(f"robot {target!r}: not here, must be leader, {', '.join(COMMON)} or one of {ids}")
    return victim


def _leader(fleet: str, bus: ZenohBus, inbox: Inbox) -> int | None:
    """Listen for a second and return the robot that claims leadership in the highest term, or None."""
    bus.follow(frozenset({key(fleet, "*", "pose")}))
    clock.sleep(LISTEN_S)
    state = FleetState()
    for arrival, message in Decoder().messages(inbox.take()):
        state.update(arrival.at, message)
    return state.leader(clock.now())


def _bus(agent: Running, inbox: Inbox) -> ZenohBus:
    known = None if agent.keys is None else credentials(agent.keys, OPERATOR_NAME, clock.wall_ms())
    try:
        return ZenohBus(agent.endpoint, inbox, credentials=known)
    except RouterAbsent:
        raise Refused(f"no router answers at {agent.endpoint}, where robot {agent.robot} looks for it") from None
