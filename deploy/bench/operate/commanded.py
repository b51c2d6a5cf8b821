"""A team in virtual time with an operator who stops it and sends it to goals."""

from __future__ import annotations

from msgspec import structs

from lfa.agents.orders.team_orders import QUESTION
from lfa.deploy.client.operator import Operator
from lfa.deploy.client.order_call import Change, OrderCall
from lfa.deploy.client.stop_call import StopOutcome
from lfa.deploy.client.stop_node import StopNode
from lfa.deploy.fuzz.agent_simulation import FLEET, AgentSimulation
from lfa.deploy.fuzz.network import FAIR
from lfa.deploy.fuzz.schedules import draw
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.orders import OrderNote
from lfa.protocol.messages.simulation import TrueRobot, Truth
from lfa.protocol.messages.team import Event
from lfa.protocol.runtime.journal import JOURNAL_VERSION, Heading, Journal
from lfa.protocol.transport.message_bus import send

STEP_S = 0.002
REST_MPS = 1e-6


class CommandedTeam:
    """Team of `robots` on a straight road; the seed draws its clocks and delays."""

    def __init__(self, robots: int, seed: int) -> None:
        calm = structs.replace(
            draw(seed), robots=robots, profile="std", witness=True, faults=(), spares=(), stops=(), radio=FAIR
        )
        self.team = AgentSimulation(structs.replace(calm, rates={}))
        self.robots: dict[int, TrueRobot] = {}
        """True state of each robot, as last told."""
        self.moved_at = 0.0
        """Time [s] at which a robot was last seen to move."""
        self._call: OrderCall | None = None
        self.team.simulator.taps.append(self._hear)
        self.team.start_all()

    def _hear(self, now: float, _key: str, _payload: bytes, message: Message) -> None:
        match message:
            case Truth():
                self.robots = {robot.id: robot for robot in message.robots}
                if any(abs(robot.linear_x) > REST_MPS for robot in message.robots):
                    self.moved_at = now
            case OrderNote() | Event() if self._call is not None:
                self._call.hear(message)

    def stop(self) -> StopOutcome:
        """Say stop, and run until the outcome is final."""
        node = StopNode(FLEET, "operator", 1, self.team.mission.robots, stand=True)
        heading = Heading(JOURNAL_VERSION, node.name, node.incarnation, 1, {})
        self.team.simulator.add(node, Journal(None, heading))
        while node.outcome is None:
            self.team.run(self.team.now + STEP_S)
        return node.outcome

    def order_and_kill(self, change: Change, after_s: float) -> None:
        """Order `change`, kill the leader `after_s` [s] after the first word, and go on until the order is known."""
        team, operator = self.team, Operator(FLEET, 1)
        call = self._call = OrderCall(change, False, team.now)
        call.hear_mission(team.mission)
        send(team.simulator, operator.ask(QUESTION, team.now))
        kill_at: float | None = None
        killed = False
        while call.outcome(team.now) is None or not killed:
            order = call.said(team.now)
            if order is not None:
                kill_at = team.now + after_s if kill_at is None else kill_at
                send(team.simulator, operator.order(order, team.now))
            if kill_at is not None and team.now >= kill_at and not killed:
                team.kill(team.leaders()[0])
                killed = True
            team.run(team.now + STEP_S)
