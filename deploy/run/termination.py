"""Termination of a run: the verdict, decided once from the messages. Pure: time comes with the messages.

A run has reached its goal when the leader of the present chain is within the goal's tolerance and all robots of that
chain have been at rest for `REST_S`. It has failed when an agent publishes a `failed` event, and has run out of time
when the world's clock passes the scenario's limit.
"""

from __future__ import annotations

from math import hypot

from lfa.deploy.recording.outcome import Verdict
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.consensus import NO_TERM, Term
from lfa.protocol.messages.simulation import TrueRobot, Truth
from lfa.protocol.messages.team import Event
from lfa.protocol.names import robot_id_of
from lfa.world.description.load import Scenario

REST_S = 0.5
REST_SPEED = 1e-3  # [m/s] and [rad/s]


class Referee:
    """Judge of a run from every Truth and Event; `verdict` is None until the run is over.

    `chain` is the present chain, `leader` the robot whose leader command of the highest term was accepted last.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._term = NO_TERM
        self._led = NO_TERM
        self.chain: tuple[int, ...] = scenario.mission.robots
        self.leader: int | None = None
        self._resting_since: float | None = None
        self.verdict: Verdict | None = None

    def see(self, message: Message) -> Verdict | None:
        """Update with a message and return the verdict, or None while the run goes on."""
        if self.verdict is None:
            match message:
                case Truth():
                    self.verdict = self._judge(message)
                case Event(kind="failed"):
                    who = robot_id_of(message.header.sender)
                    self.verdict = Verdict("failed", f"robot {who}: {message.data.get('reason', 'gives up')}")
                case Event(kind="chain", term=Term() as term) if term >= self._term:
                    self._term = term
                    self.chain = _ids(message.data.get("chain")) or self.chain
                case Event(kind="leader_command", term=Term() as term) if term >= self._led:
                    self._led = term
                    self.leader = next(iter(_ids([message.data.get("robot")])), self.leader)
        return self.verdict

    def _judge(self, truth: Truth) -> Verdict | None:
        if not self._arrived(truth.robots):
            self._resting_since = None
        elif self._resting_since is None:
            self._resting_since = truth.time_s
        elif truth.time_s >= self._resting_since + REST_S:
            return Verdict("goal_reached")
        if truth.time_s >= self._scenario.time_limit_s:
            return Verdict("time_limit", f"not at the goal after {self._scenario.time_limit_s:g} s")
        return None

    def _arrived(self, robots: tuple[TrueRobot, ...]) -> bool:
        mission = self._scenario.mission
        present = {robot.id: robot for robot in robots if robot.id in self.chain}
        leader = present.get(self.chain[0]) if self.chain else None
        if leader is None:
            return False
        goal_x, goal_y = mission.goal_m
        near = hypot(leader.x - goal_x, leader.y - goal_y) <= mission.leading.goal_tolerance_m
        return near and all(_at_rest(robot) for robot in present.values())


def _ids(said: object) -> tuple[int, ...]:
    """Return the robot ids in an event's data, which any sender may have written."""
    return tuple(i for i in said if isinstance(i, int)) if isinstance(said, list | tuple) else ()


def _at_rest(robot: TrueRobot) -> bool:
    return abs(robot.linear_x) < REST_SPEED and abs(robot.angular_z) < REST_SPEED
