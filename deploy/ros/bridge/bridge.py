"""The middle of a bridge: from a fleet's messages through the mapping to an output, ROS or Foxglove."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable
from typing import Protocol

from lfa.deploy.client.mission_changes import along, to_goal, unchanged
from lfa.deploy.client.operator import Operator
from lfa.deploy.client.order_calls import OrderCalls
from lfa.deploy.client.order_fleet import walls_of
from lfa.deploy.client.session import Subscriber, scenario_of_fleet
from lfa.deploy.client.stop_call import Said
from lfa.deploy.ros import messages
from lfa.deploy.ros.bridge.answers import answer
from lfa.deploy.ros.bridge.outward import BRIDGE_NODE
from lfa.deploy.ros.bridge.sender_clocks import SenderClocks
from lfa.deploy.ros.bridge.stop_calls import StopCalls
from lfa.deploy.ros.mapping import FleetMapping, RosMessage
from lfa.deploy.ros.session import ServiceCall
from lfa.deploy.ros.topics import ON_DEMAND, SOURCES, WORLD_TIME, sources_heard
from lfa.deploy.terminal_text import print_visible
from lfa.protocol import clock, incarnations
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.orders import OrderNote
from lfa.protocol.messages.simulation import Truth
from lfa.protocol.messages.stop import StopState
from lfa.protocol.messages.team import Event, MissionNote
from lfa.protocol.names import robot_id_of
from lfa.protocol.output import visible
from lfa.protocol.topics import address
from lfa.protocol.transport.message_bus import send

PERIOD_S = 0.02
SLOW_S = 0.1
"""Period [s] of what is shown ten times a second, and of looking who hears what."""
EAGER = frozenset({"sensors", "scan"})
"""Topics that are passed on at once; all others within a period."""
ALWAYS = (SOURCES - ON_DEMAND) | {"*/stop_state", "*/team_order"}
"""Topics that a bridge always hears: what it keeps for latecomers, and answers to a stop and to a changed mission."""
PULLED_FAST, PULLED_SLOWLY = frozenset({"*/cmd_vel"}), frozenset({"*/pose", "*/tracking"})
"""Topics that wait until the bridge reads them, every PERIOD_S or every SLOW_S."""
_WAITED = frozenset(topic.removeprefix("*/") for topic in PULLED_FAST | PULLED_SLOWLY)


class Output(Protocol):
    """Where ROS messages go."""

    @property
    def robots(self) -> frozenset[int]:
        """Robots whose topics exist."""

    def heard(self, topic: str) -> bool:
        """Return True if someone listens to `topic`."""

    def join(self, robot: int) -> None:
        """Create a robot's topics."""

    def leave(self, robot: int) -> None:
        """Remove a robot's topics."""

    def publish(self, sent: Iterable[RosMessage]) -> None:
        """Publish messages; those on topics that do not exist are dropped."""


class Bridge:
    """State of one bridge; `step` passes on what came in since the last call."""

    def __init__(self, subscriber: Subscriber, output: Output, *, sim_time: bool, tf_per_robot: bool) -> None:
        self._subscriber = subscriber
        self._tf_per_robot = tf_per_robot
        self._always = ALWAYS | {WORLD_TIME} if sim_time else ALWAYS
        self._followed: frozenset[str] = frozenset()
        self._look_at = self._pull_at = 0.0
        self._operator = Operator(subscriber.fleet.name, incarnations.drawn())
        self._output = output
        self._mapping = FleetMapping(tf_per_robot=tf_per_robot, sim_time=sim_time, heard=output.heard)
        self._robots: tuple[int, ...] = ()
        """Robots of the mission; empty until it is known."""
        self._stops = StopCalls(self._say_stop)
        self._orders = OrderCalls(self._operator, lambda envelope: send(subscriber.bus, envelope))
        scenario = scenario_of_fleet(subscriber.fleet)
        if scenario is not None:
            self._mapping.set_mission(scenario.mission)
            self._robots = scenario.mission.robots
        self._clocks = SenderClocks(time.time_ns() - round(1e9 * clock.now()), sim_time=sim_time)

    @property
    def leader(self) -> int:
        """Robot that leads; 0: none."""
        return self._mapping.leader

    def step(self, now: float) -> None:
        """Publish what the fleet said."""
        self._listen(now)
        arrivals = self._subscriber.take()
        self._follow_robots()
        present = self._output.robots
        for arrival, message in arrivals:
            if isinstance(message, Truth):
                self._clocks.see_world(arrival.at, message.time_s)
                continue
            where = address(arrival.key)
            assert where is not None, "else it had not been decoded"
            robot = robot_id_of(where.owner)
            self._hear_answer(robot, message, now)
            if self._clocks.ready and (not robot or robot in present):
                stamp_ns = self._clocks.stamp_ns(message.header, arrival.at, prompt=where.topic not in _WAITED)
                self._output.publish(self._mapping.update(stamp_ns, where.owner, message))
        if self._clocks.ready:
            self._output.publish(self._mapping.tick(self._clocks.now_ns(now)))
        self._stops.step(now)
        self._orders.step(now)

    def period_s(self) -> float:
        """Return the time [s] after which `step` is due, whatever comes in: long while nobody hears what moves."""
        return PERIOD_S if self._followed & ON_DEMAND or WORLD_TIME in self._always else SLOW_S

    def _listen(self, now: float) -> None:
        """Hear what somebody on the other side hears, and read what waits, when that is due."""
        if now >= self._pull_at:
            self._pull_at = _next(self._pull_at, PERIOD_S, now)
            self._subscriber.pull(PULLED_FAST)
        if now < self._look_at:
            return
        self._look_at = _next(self._look_at, SLOW_S, now)
        output = self._output
        wanted = self._always | sources_heard(output.robots, output.heard, tf_per_robot=self._tf_per_robot)
        if wanted != self._followed:
            self._followed = wanted
            self._subscriber.follow(wanted, PULLED_FAST | PULLED_SLOWLY)
        self._subscriber.pull(PULLED_SLOWLY)

    def _hear_answer(self, robot: int | None, message: Message, now: float) -> None:
        """Take what answers a stop or a change of the mission."""
        match message:
            case StopState() if robot:
                self._stops.hear(robot, message, now)
            case OrderNote() | Event():
                self._orders.hear(message)
            case MissionNote(mission=mission):
                self._robots = mission.robots
                self._orders.hear_mission(mission)

    def _follow_robots(self) -> None:
        """Declare robots whose tokens appeared, undeclare those whose tokens vanished."""
        living = {robot for name in self._subscriber.living if (robot := robot_id_of(name))}
        for robot in living - self._output.robots:
            self._output.join(robot)
        for robot in self._output.robots - living:
            self._mapping.forget(robot)
            self._output.leave(robot)

    def order(self, name: str, **arguments: object) -> None:
        """Send an operator's command to the fleet."""
        send(self._subscriber.bus, self._operator.command(name, clock.now(), **arguments))

    def stop(self, call: ServiceCall, now: float, *, stand: bool) -> None:
        """Say stop (`stand`) or resume to every gateway; `call` is answered by what became of it."""
        self._stops.ask(call, {*self._robots, *self._output.robots}, now, stand=stand)

    def pause(self, call: ServiceCall, now: float, *, paused: bool) -> None:
        """Let the leader stand, or drive on; `call` is answered when the team knows it, or by why it does not."""
        self._orders.begin(unchanged, paused, now, lambda success, text: answer(call, success=success, text=text))

    def go(self, x: float, y: float, theta_deg: float, now: float) -> None:
        """Send the team to a goal in `map` [m, degrees]; warns if that is not carried out. Raises Refused."""
        points = to_goal(x, y, theta_deg)

        def tell(success: bool, text: str) -> None:
            if not success:
                self.warn(f"goal ({x:g}, {y:g}): {text}")

        self._orders.begin(along(points, walls_of(self._subscriber)), False, now, tell)

    def _say_stop(self, said: Said, now: float) -> None:
        send(self._subscriber.bus, self._operator.stop(said.word, said.gateways, now))

    def warn(self, words: str) -> None:
        """Print a warning, and publish it on /rosout."""
        print_visible(visible(f"lfa: {words}"), file=sys.stderr, flush=True)
        stamp_ns = self._clocks.now_ns(clock.now())
        self._output.publish([RosMessage("/rosout", stamp_ns, messages.log(stamp_ns, "warn", BRIDGE_NODE, words))])


def _next(due: float, period_s: float, now: float) -> float:
    """Return when something is due again that was due at `due`; a pause is not made up for."""
    return due + period_s if now < due + period_s else now + period_s
