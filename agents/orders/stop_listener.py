"""The fleet stop as one agent hears it: orders, its gateway, and questions of agents and operators (E28 to E30)."""

from __future__ import annotations

from math import inf

from lfa.protocol.fleet_stop.memory import StopMemory
from lfa.protocol.messages.robot import Sensors
from lfa.protocol.messages.stop import StopKnowledge, StopOrder, StopReport
from lfa.protocol.messages.team import Ask
from lfa.protocol.names import robot_id_of
from lfa.protocol.outbox import Outbox

StopMessage = StopOrder | StopReport | Ask
QUESTION = "stop"
ANSWER_S_MIN = 0.02
"""Time [s] between two answers: one is heard by all that ask at the moment."""


class StopListener:
    """Fleet stop at the agent of robot `robot_id` in a team of `robots`."""

    def __init__(self, robot_id: int, robots: tuple[int, ...], outbox: Outbox) -> None:
        self.memory = StopMemory(robot_id, robots)
        self._outbox = outbox
        self._gateway_stands = False
        self._answered_at = -inf

    @property
    def known(self) -> StopKnowledge:
        """What this agent knows, for its commands."""
        return self.memory.known

    @property
    def stands(self) -> bool:
        """True while this robot's wheels must not or cannot turn."""
        return self._gateway_stands or self.memory.stands

    def text(self) -> str:
        """Return why this robot stands, as text for its status; empty if no stop holds it."""
        if self.memory.stands:
            return "stopped: lfa resume lets it go"
        if self._gateway_stands and not self.memory.certain:
            return "stands until others say that nobody has stopped the fleet: lfa resume lets it go"
        return ""

    def hear_sensors(self, sensors: Sensors) -> None:
        """Update with the state of the own gateway."""
        self._gateway_stands = sensors.stands
        self.memory.hear_gateway(sensors.stop)

    def receive(self, message: StopMessage, now: float) -> None:
        """Process an order, an answer, or a question of an agent that has started."""
        match message:
            case StopOrder():
                self.memory.order(message)
            case StopReport(known=known):
                robot = robot_id_of(message.header.sender)
                if robot is not None:
                    self.memory.hear_agent(robot, known)
            case Ask(what=what) if what == QUESTION and now - self._answered_at >= ANSWER_S_MIN:
                self._answered_at = now
                header = self._outbox.header("stop_known", now)
                self._outbox.publish("stop_known", StopReport(header, self.known, self.memory.robots))

    def step(self, now: float) -> None:
        """Ask the other agents if this one does not know enough, once in a while."""
        if self.memory.ask_due(now):
            self._outbox.publish("ask", Ask(self._outbox.header("ask", now), QUESTION))
