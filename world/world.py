"""The simulated world as a Node: commands in through the gateways, bodies stepped together, sensors out.

It publishes the topics of robot hardware, and besides only the mission, events, and ground truth, to which no agent may
subscribe. Its time runs on the grid t0 + n/physics_hz: sensors are stamped with the time of their state, however late
the tick comes. A delay too long to catch up with slows the world down instead, and is counted.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import inf

import msgspec

from lfa.protocol.geometry import Twist
from lfa.protocol.lease.gateway import Gateway
from lfa.protocol.lease.timing import timing_for
from lfa.protocol.messages.consensus import Fence, LeaseNote, Term
from lfa.protocol.messages.robot import CmdVel, Localization, Sensors
from lfa.protocol.messages.simulation import Clock, TrueObstacle, TrueRobot, Truth
from lfa.protocol.messages.stop import StopOrder
from lfa.protocol.messages.team import Ask, MissionNote, OperatorNote
from lfa.protocol.names import robot_name
from lfa.protocol.node import Envelope, PeerDown, PeerUp, Received, RouterLost, Stop, Vitals
from lfa.protocol.outbox import Outbox
from lfa.protocol.runtime.lateness import Lateness
from lfa.protocol.topics import TOPIC, TRUTH_OWNER, WORLD_NAME, address, alive_key, key
from lfa.world.added_obstacles import AddedObstacles
from lfa.world.description.placement import with_spares
from lfa.world.description.scenario import Scenario
from lfa.world.physics.kinematics import Kinematic, Touch
from lfa.world.physics.rigid_bodies import Physics
from lfa.world.robot_hardware import PARTS, RobotHardware
from lfa.world.saved_state import Memory, Remembered
from lfa.world.simulated_sensors import SimulatedSensors
from lfa.world.time_grid import TimeGrid

TRUTH_HZ, CLOCK_HZ = (TOPIC[topic].rate_hz or 0.0 for topic in ("truth", "clock"))
"""Rates [Hz] of what the world says besides what sensors measure."""


class World:
    """Simulation of a drawn `scenario` without its agents; `seed` draws the noise. Implements the Node interface.

    Its time begins with its first tick, which is due at `start_at` or at once. With a `memory` of an earlier
    incarnation it continues from there; `scenario` must then have the poses of that memory (`checkpoint.resumed`).
    """

    def __init__(
        self,
        fleet: str,
        scenario: Scenario,
        seed: int,
        incarnation: int,
        start_at: float | None = None,
        bodies: type[Physics] | type[Kinematic] = Physics,
        memory: Memory | None = None,
    ) -> None:
        self.name = WORLD_NAME
        self.incarnation = incarnation
        self.finished = False
        self.refusal: str | None = None
        self.defer_hellos = self.defer_grants = False
        self.started_with = _started_with(scenario, seed, start_at, bodies, memory)
        self._fleet = fleet
        self._announced = scenario.mission
        self._scenario = scenario = with_spares(scenario)
        self._seed = seed
        self._bodies = bodies(scenario)
        self._robots: list[RobotHardware] = []
        self._place = {robot_name(robot_id): n for n, robot_id in enumerate(scenario.mission.robots)}
        self._real = {robot_name(robot): self._place[robot_name(robot)] for robot in scenario.world.real_robots}
        """Names of robots with a driver of their own, and their indices."""
        self._simulated: list[tuple[int, RobotHardware]] = []
        """Simulated robots with their indices."""
        self._driven: dict[int, Twist] = {}
        """Twist last reported by each real robot, by its index."""
        self._cut_off = False
        mission = scenario.mission
        # Later than that, what robots echo of their odometry is too old for their gateways.
        self._lateness = Lateness(timing_for(mission).deadman_s - mission.control_period_s)
        self._added = AddedObstacles(scenario, () if memory is None else memory.added)
        self._time = TimeGrid(scenario.world.physics_hz, 0 if memory is None else memory.step, start_at)
        self._remembered = {} if memory is None else {robot.id: robot for robot in memory.robots}
        self._bodies.advance(self._time.step)
        self._outbox = Outbox(fleet, WORLD_NAME, incarnation, first=1)
        self._truths = Outbox(fleet, WORLD_NAME, incarnation, TRUTH_OWNER, first=1)
        self._sensors = SimulatedSensors(scenario, seed, self._added, self._outbox)
        self._led: tuple[int, Term] | None = None
        """Robot and term of the leader command obeyed last, over all gateways; shows a return to an older term (I2)."""
        simulated = [robot for robot in scenario.mission.robots if robot_name(robot) not in self._real]
        self.interests = _interests(fleet, simulated, self._real)

    @property
    def slowed_s(self) -> float:
        """Total time [s] for which the world's time has stood still because ticks came too late."""
        return self._time.slowed_s

    @property
    def gateways(self) -> dict[int, Gateway]:
        """Gateway of each robot by its id; empty before the first call."""
        return {robot.id: robot.gateway for robot in self._robots}

    def next_deadline(self) -> float:
        return inf if self.finished else self._time.next_point

    def receive(self, received: Received) -> list[Envelope]:
        """Process a message: commands, fences and asks take effect at once, on bodies from the next step on."""
        now, message = received.at, received.message
        if self.finished:
            return []
        self._switch_on(now)
        match message:
            case CmdVel():
                return self._command(received.key, message, now)
            case LeaseNote(body=Fence() as fence):
                return self._fence(received.key, fence, now)
            case StopOrder():
                return [robot.order(message, now) for _, robot in self._simulated if not robot.hangs("driver")]
            case Sensors() | Localization():
                self._hear_real(received.key, message)
            case Ask(what="mission"):
                return [self._mission(now)]
            case PeerUp(name=name, incarnation=incarnation) if name in self._place:
                self._cut_off = False
                self._robots[self._place[name]].gateway.agent_up(incarnation, now)
            case PeerDown(name=name, incarnation=incarnation) if name in self._place and not self._cut_off:
                self._robots[self._place[name]].gateway.agent_down(incarnation, now)
            case OperatorNote(command="hang" | "resume" as command, arguments=arguments):
                self._hang(command, arguments, now)
            case OperatorNote(command="obstacle", arguments=arguments):
                return self._set_down(arguments, now)
            case RouterLost():
                self._cut_off = True
            case Vitals(loop_lag_s=lag_s):
                return self._hear_lag(lag_s, now)
            case Stop():
                self.finished = True
        return []

    def tick(self, now: float) -> list[Envelope]:
        """Step the bodies up to `now` and return the events and sensor messages of each step."""
        if self.finished:
            return []
        sent: list[Envelope] = []
        self._switch_on(now)
        if self._time.begin(now):
            sent.append(self._mission(now))
        count, stood_still_s = self._time.due(now)
        if stood_still_s > 0.0:
            news: dict[str, object] = {"stood_still_s": stood_still_s, "t": self._time.elapsed_s}
            sent.append(self._event("slowed", None, news, now))
        for _ in range(count):
            touches = [] if self._time.is_first else self._move(now)
            sent += self._speak(self._time.next_point, now, touches)
            self._time.step += 1
        return sent

    def memory(self) -> Memory:
        """Return the state from which a next incarnation can continue."""
        robots = tuple(
            Remembered(robot.id, pose, robot.odometry.pose_odom, robot.odometry.odometer_m)
            for robot, pose in zip(self._robots, self._bodies.poses, strict=True)
        )
        return Memory(self._time.step, robots, self._bodies.moved(), self._added.all)

    def _switch_on(self, now: float) -> None:
        """Create the robots' hardware at the first call: the gateways' time starts at `now`."""
        if not self._robots:
            mission = self._scenario.mission
            self._robots = [
                RobotHardware(self._fleet, robot_id, self._scenario, self._seed, self.incarnation, now)
                for robot_id in mission.robots
            ]
            self._simulated = [(n, robot) for n, robot in enumerate(self._robots) if robot.name not in self._real]
            for robot in self._robots:
                if robot.id in self._remembered:
                    known = self._remembered[robot.id]
                    robot.odometry.pose_odom, robot.odometry.odometer_m = known.pose_odom, known.odometer_m

    def _command(self, at_key: str, cmd: CmdVel, now: float) -> list[Envelope]:
        where = address(at_key)
        place = self._place.get(where.owner) if where is not None else None
        if place is None:
            return []
        if self._robots[place].hangs("driver"):
            return []
        news = self._robots[place].command(cmd, now)
        if news is None:
            return []
        kind, data = news
        if kind == "leader_command":
            if self._led == (place, cmd.term):
                return []
            self._led = (place, cmd.term)
        return [self._event(kind, cmd.term, data | {"t": self._time.time_of(now)}, now)]

    def _fence(self, at_key: str, fence: Fence, now: float) -> list[Envelope]:
        where = address(at_key)
        to = where.to if where is not None else None
        fenced = [robot for robot in self._robots if to == _gateway_name(robot.id) and not robot.hangs("driver")]
        return [robot.fence(fence, now) for robot in fenced]

    def _hang(self, command: str, arguments: dict[str, object], now: float) -> None:
        """Let a part of a simulated robot hang, or end that."""
        part, robot_id = arguments.get("part"), arguments.get("robot")
        for _, robot in self._simulated:
            if robot.id == robot_id and part in PARTS:
                robot.hang(str(part), now) if command == "hang" else robot.resume(str(part))

    def _set_down(self, arguments: dict[str, object], now: float) -> list[Envelope]:
        """Add an obstacle during the run, and tell so; one on top of a robot is told as refused."""
        taken = self._added.take(arguments, self._bodies.poses)
        if taken is None:
            return []
        data, obstacle = taken
        if obstacle is not None:
            self._bodies.set_down(data["index"], obstacle)
            self._sensors.set_down(obstacle)
        return [self._event("obstacle", None, data | {"t": self._time.time_of(now)}, now)]

    def _hear_real(self, at_key: str, message: Sensors | Localization) -> None:
        where = address(at_key)
        place = self._real.get(where.owner) if where is not None else None
        if place is None:
            return
        if isinstance(message, Sensors):
            self._driven[place] = message.twist
        else:
            self._bodies.place(place, message.pose_map)

    def _move(self, now: float) -> list[Touch]:
        wanted = [robot.twist(now) for robot in self._robots]
        for place, twist in self._driven.items():  # wheels whose driver died or hangs turn on as last commanded
            wanted[place] = twist
        touches = self._bodies.step(wanted)
        for robot, wheels in zip(self._robots, self._bodies.wheels, strict=True):
            robot.odometry.turn(wheels, self._time.dt_s)
        return touches

    def _speak(self, stamp: float, now: float, touches: list[Touch]) -> list[Envelope]:
        """Return the messages that are due at this point of the time grid."""
        sent: list[Envelope] = []
        poses, samples = self._bodies.poses, self._time.samples
        for touch in touches:
            robot = self._robots[touch.robot]
            if robot.name in self._real:
                continue
            if not robot.hangs("driver"):
                sent.append(robot.contact(stamp, poses[touch.robot], touch.x, touch.y))
            data: dict[str, object] = {"robot": robot.id, "other": touch.other, "x": touch.x, "y": touch.y}
            sent.append(self._event("contact", None, data | {"t": self._time.elapsed_s}, stamp))
        sent += self._sensors.measure(stamp, now, self._time, self._bodies, self._simulated)
        if samples(TRUTH_HZ):
            sent.append(self._truth(stamp))
        if samples(CLOCK_HZ):
            clock = Clock(self._truths.header("clock", stamp), self._time.elapsed_s)
            sent.append(self._truths.envelope("clock", clock))
        return sent

    def _truth(self, stamp: float) -> Envelope:
        robots = tuple(
            TrueRobot(robot.id, pose.x, pose.y, pose.theta, twist.linear_x, twist.angular_z)
            for robot, pose, twist in zip(self._robots, self._bodies.poses, self._bodies.twists, strict=True)
        )
        obstacles = tuple(TrueObstacle(n, pose.x, pose.y) for n, pose in self._bodies.moved().items())
        truth = Truth(self._truths.header("truth", stamp), self._time.elapsed_s, robots, obstacles)
        return self._truths.envelope("truth", truth)

    def _mission(self, now: float) -> Envelope:
        note = MissionNote.of(self._outbox.header("mission", now), self._announced)
        return self._outbox.envelope("mission", note)

    def _hear_lag(self, lag_s: float, now: float) -> list[Envelope]:
        """Take how late [s] the own loop was in one second; tell when it has become late, or no longer is."""
        if not self._lateness.update(lag_s):
            return []
        worst_s = self._lateness.worst_s
        return [self._event("late", None, {"late": worst_s > 0.0, "lag_s": round(worst_s, 3)}, now)]

    def _event(self, kind: str, term: Term | None, data: dict[str, object], stamp: float) -> Envelope:
        return self._outbox.event_envelope(kind, stamp, term, data)


def _started_with(
    scenario: Scenario,
    seed: int,
    start_at: float | None,
    bodies: type[Physics] | type[Kinematic],
    memory: Memory | None,
) -> dict[str, object]:
    """Return the arguments of a World as its journal keeps them."""
    return {
        "kind": "world",
        "scenario": msgspec.to_builtins(scenario),
        "seed": seed,
        "start_at": start_at,
        "bodies": bodies.__name__,
        "memory": msgspec.to_builtins(memory),
    }


def _interests(fleet: str, simulated: Iterable[int], real: Iterable[str]) -> frozenset[str]:
    """Return the keys that a world hears: of operators, of `simulated` robots' agents, of `real` robots' drivers."""
    return frozenset(
        {key(fleet, "*", topic) for topic in ("ask", "operator", "stop")}
        | {key(fleet, robot_name(robot_id), "cmd_vel") for robot_id in simulated}
        | {key(fleet, "*", "lease", _gateway_name(robot_id)) for robot_id in simulated}
        | {alive_key(fleet, robot_name(robot_id), "*") for robot_id in simulated}
        | {key(fleet, name, topic) for name in real for topic in ("sensors", "localization")}
    )


def _gateway_name(robot_id: int) -> str:
    """Return the receiver name of a FENCE in its key."""
    return f"gateway{robot_id}"
