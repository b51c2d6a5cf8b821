"""Observer of a simulated world: it reports the commands and fences that gateways accepted."""

from __future__ import annotations

from collections.abc import Callable

from lfa.protocol.messages.consensus import Fence, LeaseNote
from lfa.protocol.messages.robot import CmdVel
from lfa.protocol.names import robot_id_of
from lfa.protocol.node import Received
from lfa.protocol.topics import address
from lfa.world.simulator import Simulator
from lfa.world.world import World

Tell = Callable[..., None]
"""Receiver of a fact for the checkers: the name of a method of `Checker`, and its arguments."""


class GatewayObserver:
    """Observer of a world, and so of all gateways. `accepted` collects leader commands that were accepted."""

    def __init__(self, simulator: Simulator, world: World, tell: Tell, accepted: list[tuple[float, CmdVel]]) -> None:
        self._simulator = simulator
        self._world = world
        self._tell = tell
        self._accepted = accepted
        self._refused = 0

    def before(self, received: Received) -> None:
        """Remember how many commands the gateway has refused."""
        if isinstance(received.message, CmdVel):
            self._refused = self._refused_by(_robot_of(received))

    def after(self, received: Received) -> None:
        """Report a command that the gateway has accepted, or a fence, which it always obeys."""
        now, message = self._simulator.now, received.message
        match message:
            case CmdVel():
                robot = _robot_of(received)
                if self._refused_by(robot) == self._refused:
                    if message.as_leader:
                        self._accepted.append((now, message))
                    self._tell("obeys", now, robot, message, received.at - message.gateway.time)
                    self._tell("bars", now, robot, message.term)
            case LeaseNote(body=Fence(term=term)):
                self._tell("bars", now, _robot_of(received), term)

    def _refused_by(self, robot: int | None) -> int:
        """Return the number of commands that the robot's gateway has refused so far."""
        gateway = self._world.gateways.get(robot) if robot is not None else None
        return 0 if gateway is None else sum(gateway.refused.values())


def _robot_of(received: Received) -> int | None:
    """Return the robot whose gateway the message is for."""
    where = address(received.key)
    if where is None:
        return None
    is_command = isinstance(received.message, CmdVel)
    return robot_id_of(where.owner if is_command else (where.to or "").replace("gateway", "robot"))
