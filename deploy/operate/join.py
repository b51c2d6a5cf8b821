"""`lfa join`: takes a robot that the mission does not name into a running team, or one that has retired."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import msgspec
import typer

from lfa.agents.orders.roster_orders import JOIN, ROBOT_MAX
from lfa.deploy.client.roster.roster_call import RosterOutcome
from lfa.deploy.client.roster.roster_fleet import TOPICS, change_roster
from lfa.deploy.client.session import find, listen
from lfa.deploy.operate.options import AsJson, Connect, FleetName, Keys
from lfa.deploy.terminal_text import print_visible
from lfa.protocol.errors import Refused
from lfa.protocol.names import robot_name


def command(
    robot: Annotated[int, typer.Argument(help="Id of the robot: a spare's, or that of one that has retired.")],
    slot_of: Annotated[
        int, typer.Option("--for", help="Lost robot whose place in the chain it takes; 0: the tail.")
    ] = 0,
    fleet: FleetName = None,
    connect: Connect = None,
    keys: Keys = None,
    as_json: AsJson = False,
) -> int:
    """Admit a robot to the team; return 0 if quorums have accepted it, else 1. Raises Refused, as the leader may."""
    return say(JOIN, robot, slot_of, fleet, connect, keys, as_json)


def say(
    what: str, robot: int, slot_of: int, fleet: str | None, connect: str | None, keys: Path | None, as_json: bool
) -> int:
    """Change a fleet's team, print what became of it, and return the exit code. Raises Refused."""
    if not 1 <= robot <= ROBOT_MAX:
        raise Refused(f"{what} {robot}: must be a robot's id, from 1 to {ROBOT_MAX}")
    if not 0 <= slot_of <= ROBOT_MAX:
        raise Refused(f"{what} {robot} --for {slot_of}: must be a robot's id, or 0 for the tail")
    with listen(find(fleet, connect, keys), TOPICS) as ear:
        outcome = change_roster(ear, what, robot, slot_of)
        if outcome.leader is None:
            ear.refuse_absent(f"{what} {robot}")
    if outcome.reason:
        raise Refused(outcome.reason)
    print_visible(msgspec.json.encode(outcome).decode() if as_json else outcome_text(what, outcome))
    return 0 if outcome.accepted else 1


def outcome_text(what: str, outcome: RosterOutcome) -> str:
    """Return the outcome in one line."""
    name, chain = robot_name(outcome.robot), list(outcome.chain)
    if outcome.leader is None:
        return f"{what} {outcome.robot}: no leader has answered"
    if not outcome.accepted:
        return f"{what} {outcome.robot}: no quorum has accepted it in time; the chain is {chain}"
    if what != JOIN:
        return f"{what}: {name} is out of the team; the chain is {chain}"
    if outcome.robot in outcome.chain:
        return f"{what}: {name} is in the team; the chain is {chain}"
    return f"{what}: {name} is admitted, and comes into the chain when it runs; the chain is {chain}"
