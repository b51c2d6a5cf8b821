"""Observer of a simulated world: it reports the commands and fences that gateways accepted."""

from __future__ import annotations

from lfa.deploy.analysis.verification.checker import Checker, Report
from lfa.protocol.messages.consensus import Fence, LeaseNote
from lfa.protocol.messages.robot import CmdVel
from lfa.protocol.names import robot_id_of
from lfa.protocol.node import Received
from lfa.protocol.topics import address
from lfa.world.simulator import Simulator
from lfa.world.world import World


class GatewayObserver:
    """Observer of a world, and so of all gateways. `accepted` collects leader commands that were accepted."""

    def __init__(
        self, simulator: Simulator, world: World, report: Report, accepted: list[tuple[float, CmdVel]]
    ) -> None:
        self._simulator = simulator
        self._world = world
        self._report = report
        self._accepted = accepted
        self._refused = 0

    def before(self, received: Received) -> None:
        """Remember how many commands the gateway has refused."""
        robot = _robot_of(received)
        if robot is not None:
            self._refused = self._refused_by(robot)

    def after(self, received: Received) -> None:
        """Report a command that the gateway has accepted, or a fence, which it always obeys."""
        now, robot = self._simulator.now, _robot_of(received)
        match received.message:
            case CmdVel() as command if robot is not None and self._refused_by(robot) == self._refused:
                if command.as_leader:
                    self._accepted.append((now, command))
                self._report(Checker.obeys, now, robot, command, received.at - command.gateway.time)
                self._report(Checker.bars, now, robot, command.term)
            case LeaseNote(body=Fence(term=term)) if robot is not None:
                self._report(Checker.bars, now, robot, term)

    def _refused_by(self, robot: int) -> int:
        """Return the number of commands that the robot's gateway has refused so far."""
        gateway = self._world.gateways.get(robot)
        return 0 if gateway is None else sum(gateway.refused.values())


def _robot_of(received: Received) -> int | None:
    """Return the robot whose gateway the command or fence is for; None for any other message."""
    where = address(received.key)
    match received.message:
        case CmdVel() if where is not None:
            return robot_id_of(where.owner)
        case LeaseNote(body=Fence()) if where is not None:
            return robot_id_of((where.to or "").replace("gateway", "robot"))
    return None
