"""Discovery of a fleet's agents, world and witness on this machine by the command lines of this user's processes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from msgspec import Struct

from lfa.deploy.process.identity import Identity, own_processes
from lfa.protocol.errors import Refused
from lfa.protocol.names import whole_number
from lfa.protocol.transport.zenoh_config import default_endpoint

LISTEN_S = 1.0  # time to listen [s]: 50 poses of a leader
DEFAULT_LISTEN = (default_endpoint(), "tcp/127.0.0.1:7450")
"""Endpoints on which a router without `--listen` listens."""


class Running(Struct, frozen=True):
    """Running process of one agent, of a world or of a witness."""

    robot: int
    """0: a world or a witness."""
    fleet: str
    endpoint: str
    identity: Identity
    keys: Path | None = None
    """Value of its option --keys."""


def agents() -> list[Running]:
    """Return this user's agents that run on this machine."""
    return [member for member in members() if member.robot]


def members() -> list[Running]:
    """Return this user's agents, worlds and witnesses that run on this machine: a host may have a world alone."""
    found = (_member(identity) for identity in own_processes())
    return [member for member in found if member is not None]


def _member(identity: Identity) -> Running | None:
    words = identity.arguments
    if not programs(words) & {"lfa.agents.cli", "lfa-agent", "lfa.world.cli", "lfa-world"}:
        return None
    robot = whole_number(option(words, "--id", "")) or 0
    endpoint = option(words, "--connect", default_endpoint())
    keys = option(words, "--keys", "")
    return Running(robot, option(words, "--fleet", "fleet"), endpoint, identity, Path(keys) if keys else None)


def programs(words: Sequence[str]) -> set[str]:
    """Return what a command line may run: the last parts of its first words, `python -P -m MODULE` or a script."""
    return {word.rpartition("/")[2] for word in words[:4]}


def option(words: Sequence[str], name: str, default: str) -> str:
    """Return the value of `--name value` or `--name=value` in `words`, else `default`."""
    for word, following in zip(words, [*words[1:], ""], strict=True):
        if word == name:
            return following
        if word.startswith(f"{name}="):
            return word.partition("=")[2]
    return default


def one_fleet(running: Sequence[Running], fleet: str | None) -> list[Running]:
    """Return the agents of `fleet`, or of the only fleet that runs here. Raises Refused if that is not unique."""
    fleets = sorted({agent.fleet for agent in running})
    if not fleets:
        raise Refused("no agent of yours runs on this machine: start one with lfa run, or lfa-agent")
    if fleet is None and len(fleets) > 1:
        raise Refused(f"several fleets run here: say --fleet {' or --fleet '.join(fleets)}")
    if fleet is not None and fleet not in fleets:
        raise Refused(f"--fleet {fleet}: no such fleet here, must be one of {', '.join(fleets)}")
    return [agent for agent in running if agent.fleet == (fleet or fleets[0])]
