"""Times of poses and commands along a chain, from the journals of world and agents: all stamps are of one clock.

A follower's command at its control step uses the newest pose of its predecessor that has arrived by then. Journals say
when a message was published (its header) and when it arrived (the entry).
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from msgspec import Struct

from lfa.protocol.messages.robot import CmdVel
from lfa.protocol.messages.team import PoseStamped
from lfa.protocol.names import robot_name
from lfa.protocol.runtime import journal
from lfa.protocol.topics import WORLD_NAME, address, message_in


class Hop(Struct, frozen=True, gc=False):
    """One command of a follower, and the pose that it used; all times [s] of the machine's clock."""

    published_at: float
    """When the predecessor published the pose."""
    arrived_at: float
    """When it arrived at the follower."""
    step_at: float
    """When the follower's control step began."""
    accepted_at: float
    """When its command arrived at the gateway."""

    @property
    def latency_s(self) -> float:
        """Time [s] from pose to command, less the wait for the control step."""
        return (self.arrived_at - self.published_at) + (self.accepted_at - self.step_at)

    @property
    def wait_s(self) -> float:
        """Time [s] that the pose has waited for the control step: what a step on its arrival would gain."""
        return self.step_at - self.arrived_at


def hops_of(folder: Path, chain: Sequence[int]) -> list[list[Hop]]:
    """Return the hops of each follower of `chain`, in the order of the chain and of time."""
    commands = _commands(folder)
    return [
        _hops(_poses(folder, ahead, robot), commands.get(robot_name(robot), [])) for ahead, robot in pairwise(chain)
    ]


def ages_s(hops: Sequence[Sequence[Hop]]) -> list[float]:
    """Return, for each command of the last follower, the age [s] of what it says of the leader.

    The pose that it used came from a control step of its predecessor, which used an older one of the robot before, and
    so on up to the leader's.
    """
    steps = [[hop.step_at for hop in one] for one in hops]
    ages = []
    for last in hops[-1]:
        published_at: float | None = last.published_at
        for times, one in zip(reversed(steps[:-1]), reversed(hops[:-1]), strict=True):
            place = bisect_right(times, published_at) - 1 if published_at is not None else -1
            published_at = one[place].published_at if place >= 0 else None
        if published_at is not None:
            ages.append(last.accepted_at - published_at)
    return ages


def _hops(poses: Sequence[tuple[float, float]], commands: Sequence[tuple[float, float]]) -> list[Hop]:
    """Return a hop for each command (step, acceptance) after the first pose (arrival, publication)."""
    arrivals = [arrived_at for arrived_at, _ in poses]
    hops = []
    for step_at, accepted_at in commands:
        place = bisect_right(arrivals, step_at) - 1
        if place >= 0:
            arrived_at, published_at = poses[place]
            hops.append(Hop(published_at, arrived_at, step_at, accepted_at))
    return hops


def _poses(folder: Path, ahead: int, robot: int) -> list[tuple[float, float]]:
    """Return arrival and publication [s] of each pose of `ahead` at `robot`."""
    found = []
    for file in folder.glob(f"{robot_name(robot)}-*.bin"):
        for entry in journal.read(file)[1]:
            if entry.kind == "message" and entry.key.endswith(f"/{robot_name(ahead)}/pose"):
                message = message_in(entry.key, entry.payload)
                if isinstance(message, PoseStamped):
                    found.append((entry.at, message.header.stamp))
    return sorted(found)


def _commands(folder: Path) -> dict[str, list[tuple[float, float]]]:
    """Return step and arrival [s] of each command at the world, by the robot's name."""
    found: dict[str, list[tuple[float, float]]] = {}
    for file in folder.glob(f"{WORLD_NAME}-*.bin"):
        for entry in journal.read(file)[1]:
            where = address(entry.key) if entry.kind == "message" else None
            if where is not None and where.topic == "cmd_vel":
                message = message_in(entry.key, entry.payload)
                if isinstance(message, CmdVel):
                    found.setdefault(where.owner, []).append((message.header.stamp, entry.at))
    return {name: sorted(commands) for name, commands in found.items()}
