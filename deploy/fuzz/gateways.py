"""Simulated gateways: one for each robot, with its own clock, and the commands that reach it."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from msgspec import Struct

from lfa.deploy.analysis.verification.checker import Checker
from lfa.deploy.fuzz.network import Network
from lfa.protocol.lease.gateway import Gateway
from lfa.protocol.lease.timing import Timing
from lfa.protocol.messages.consensus import Fence, Fenced, GatewayStamp, LeaseBody, Member
from lfa.protocol.messages.robot import CmdVel
from lfa.protocol.transport.link_model import Radio
from lfa.world.virtual_time import LocalClock


class RunningGateway(NamedTuple):
    """Gateway of a robot, and the time [s] by its own clock."""

    gateway: Gateway
    local_s: float


class GatewayHost(Struct):
    """One incarnation of one robot's gateway, and its clock."""

    gateway: Gateway
    clock: LocalClock
    born_at: float
    alive: bool = True


class GatewaySimulation(Network):
    """Network with gateways. Incarnations of processes and gateways are counted together."""

    def __init__(
        self,
        seed: int,
        ids: tuple[int, ...],
        radio: Radio,
        gateways_at: int | None,
        timing: Timing,
        rates: dict[int, float],
        gateway_type: Callable[..., Gateway],
    ) -> None:
        """Create the network without gateway. `rates` are clock rates by id, a gateway's by minus the id; default 1."""
        super().__init__(seed, ids, radio, gateways_at)
        self.timing = timing
        self.rates = rates
        self.gateways: dict[int, GatewayHost] = {}
        self.accepted: list[tuple[float, CmdVel]] = []
        """Leader commands that a gateway accepted, each with its true time [s]."""
        self._gateway_type = gateway_type
        self._incarnations = 0
        self._grant_s = timing.grant_s

    def start_gateway(self, robot_id: int, at: float | None = None) -> None:
        """Start a new incarnation of a robot's gateway; with `at` in the past it has been running since then."""
        born_at = self.now if at is None else at
        self._incarnations += 1
        clock = LocalClock(self.random.uniform(0.0, 1000.0), self.rates.get(-robot_id, 1.0))
        gateway = self._gateway_type(robot_id, self._incarnations, self.timing, clock.local(born_at))
        self.gateways[robot_id] = GatewayHost(gateway, clock, born_at)
        self._report(Checker.gateway_starts, self.now, robot_id, born_at + self._grant_s / clock.rate)

    def kill_gateway(self, robot_id: int) -> None:
        self.gateways[robot_id].alive = False

    def gateway_now(self, robot_id: int) -> RunningGateway | None:
        """Return a robot's gateway with its own time [s]; None while it is down."""
        host = self.gateways.get(robot_id)
        if host is None or not host.alive:
            return None
        return RunningGateway(host.gateway, host.clock.local(self.now))

    def latch(self, robot_id: int, incarnation: int) -> None:
        """Deliver the liveliness event of the agent's vanished token to the robot's gateway, true or false."""
        host = self.gateways.get(robot_id)
        if host is not None and host.alive:
            host.gateway.agent_down(incarnation, host.clock.local(self.now))

    def stamp(self, robot_id: int) -> GatewayStamp | None:
        """Return the newest gateway stamp that reached the robot, one hop old; None if it is disconnected."""
        host = self.gateways.get(robot_id)
        delay = self.random.uniform(0.0005, 0.002)
        if host is None or not host.alive or self.now - delay < host.born_at:
            return None
        if (self.host_of_gateway(robot_id), robot_id) in self.cuts:
            return None
        return host.gateway.stamp(host.clock.local(self.now - delay))

    def command(self, robot_id: int, cmd: CmdVel) -> None:
        """Send `cmd` from the robot's process to its gateway."""
        for delay in self.delays(robot_id, -robot_id):
            self.at(self.now + delay, self._commanded, robot_id, cmd)

    def _commanded(self, robot_id: int, cmd: CmdVel) -> None:
        host = self.gateways.get(robot_id)
        if host is None or not host.alive:
            return
        local = host.clock.local(self.now)
        if host.gateway.command(cmd, local) is not None:
            return
        if cmd.as_leader:
            self.accepted.append((self.now, cmd))
        self._report(Checker.obeys, self.now, robot_id, cmd, local - cmd.gateway.time)
        self._report(Checker.bars, self.now, robot_id, cmd.term)

    def fence(self, robot_id: int, body: LeaseBody) -> tuple[Member, Fenced] | None:
        """Return the gateway as sender and its answer to a FENCE; None for other messages or a gateway that is down."""
        host = self.gateways.get(robot_id)
        if host is None or not host.alive or not isinstance(body, Fence):
            return None
        answer = host.gateway.fence(body, host.clock.local(self.now))
        self._report(Checker.bars, self.now, robot_id, answer.term)
        return Member(robot_id, host.gateway.incarnation), answer
