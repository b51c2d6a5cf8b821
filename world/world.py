"""The simulated world as a Node: commands in through the gateways, bodies stepped together, sensors out.

It publishes the topics of robot hardware, and besides only the mission, events, and ground truth, to which no agent may
subscribe. Its time runs on the grid t0 + n/physics_hz: sensors are stamped with the time of their state, however late
the tick comes. A delay too long to catch up with slows the world down instead, and is counted.
"""

from __future__ import annotations

from math import inf

import msgspec
from msgspec.structs import replace

from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.lease.gateway import Gateway
from lfa.protocol.messages.consensus import Fence, LeaseNote, Term
from lfa.protocol.messages.robot import CmdVel, Localization, Sensors
from lfa.protocol.messages.simulation import Clock, TrueObstacle, TrueRobot, Truth
from lfa.protocol.messages.stop import StopOrder
from lfa.protocol.messages.team import Ask, MissionNote, OperatorNote
from lfa.protocol.names import robot_name
from lfa.protocol.node import Envelope, PeerDown, PeerUp, Received, RouterLost, Stop
from lfa.protocol.outbox import Outbox
from lfa.protocol.topics import TOPIC, TRUTH_OWNER, WORLD_NAME, address, alive_key, key
from lfa.world.added_obstacles import AddedObstacles
from lfa.world.description.own_sensor import TrueState
from lfa.world.description.placement import with_spares
from lfa.world.description.scenario import Scenario
from lfa.world.physics.kinematics import Kinematic, Touch
from lfa.world.physics.rigid_bodies import Physics
from lfa.world.robot_hardware import PARTS, RobotHardware
from lfa.world.saved_state import Memory, Remembered
from lfa.world.sensors.ground_sensor import Profiler
from lfa.world.sensors.lidar import Scanner
from lfa.world.sensors.own_sensors import OwnSensors
from lfa.world.time_grid import TimeGrid

FIX_HZ, GROUND_HZ, TRUTH_HZ, CLOCK_HZ = (
    TOPIC[topic].rate_hz or 0.0 for topic in ("localization", "ground", "truth", "clock")
)
"""Rates [Hz] of what the world says besides sensors and scans."""


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
        self.started_with = {
            "kind": "world",
            "scenario": msgspec.to_builtins(scenario),
            "seed": seed,
            "start_at": start_at,
            "bodies": bodies.__name__,
            "memory": msgspec.to_builtins(memory),
        }
        self._fleet = fleet
        self._announced = scenario.mission
        self._scenario = scenario = with_spares(scenario)
        self._seed = seed
        self._bodies = bodies(scenario)
        self._scanner = Scanner(scenario)
        self._profiler = Profiler(scenario)
        self._own_sensors = OwnSensors(scenario, seed, scenario.mission.robots)
        self._robots: list[RobotHardware] = []
        self._names = [robot_name(robot_id) for robot_id in scenario.mission.robots]
        self._place = {name: n for n, name in enumerate(self._names)}
        self._real = {robot_name(robot): self._place[robot_name(robot)] for robot in scenario.world.real_robots}
        """Names of robots with a driver of their own, and their indices."""
        simulated = [robot for robot in scenario.mission.robots if robot_name(robot) not in self._real]
        self._simulated: list[tuple[int, RobotHardware]] = []
        """Simulated robots with their indices."""
        self._driven: dict[int, Twist] = {}
        """Twist last reported by each real robot, by its index."""
        self._cut_off = False
        self._added = AddedObstacles(scenario, () if memory is None else memory.added)
        self._time = TimeGrid(scenario.world.physics_hz, 0 if memory is None else memory.step, start_at)
        self._remembered = {} if memory is None else {robot.id: robot for robot in memory.robots}
        self._bodies.advance(self._time.step)
        self._outbox = Outbox(fleet, WORLD_NAME, incarnation, first=1)
        self._truths = Outbox(fleet, WORLD_NAME, incarnation, TRUTH_OWNER, first=1)
        self._led: tuple[int, Term] | None = None
        """Robot and term of the leader command obeyed last, over all gateways; shows a return to an older term (I2)."""
        self.interests = frozenset(
            {key(fleet, "*", topic) for topic in ("ask", "operator", "stop")}
            | {key(fleet, robot_name(robot_id), "cmd_vel") for robot_id in simulated}
            | {key(fleet, "*", "lease", _gateway_name(robot_id)) for robot_id in simulated}
            | {alive_key(fleet, robot_name(robot_id), "*") for robot_id in simulated}
            | {key(fleet, name, topic) for name in self._real for topic in ("sensors", "localization")}
        )

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
            case Sensors(twist=twist):
                self._hear_real(received.key, None, twist)
            case Localization(pose_map=pose):
                self._hear_real(received.key, pose, None)
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
            self._scanner.set_down(obstacle)
        return [self._event("obstacle", None, data | {"t": self._time.time_of(now)}, now)]

    def _hear_real(self, at_key: str, pose: Pose2D | None, twist: Twist | None) -> None:
        where = address(at_key)
        place = self._real.get(where.owner) if where is not None else None
        if place is None:
            return
        if twist is not None:
            self._driven[place] = twist
        if pose is not None:
            self._bodies.place(place, pose)

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
        simulated = self._simulated
        for touch in touches:
            robot = self._robots[touch.robot]
            if robot.name in self._real:
                continue
            if not robot.hangs("driver"):
                sent.append(robot.contact(stamp, poses[touch.robot], touch.x, touch.y))
            data: dict[str, object] = {"robot": robot.id, "other": touch.other, "x": touch.x, "y": touch.y}
            sent.append(self._event("contact", None, data | {"t": self._time.elapsed_s}, stamp))
        if samples(self._scenario.mission.control_hz):
            driven = [robot for _, robot in simulated if not robot.hangs("driver")]
            sent += [robot.sensors(stamp, now) for robot in driven]
            sent += [rests for robot in driven if (rests := robot.come_to_rest(now)) is not None]
        if samples(FIX_HZ):
            fixes = (robot.localization(stamp, poses[n]) for n, robot in simulated if not robot.hangs("localization"))
            sent += [fix for fix in fixes if fix is not None]
        if samples(self._scenario.world.lidar.rate_hz):
            ranges = self._scanner.scan(poses, self._bodies.moved())
            sent += [robot.scan(stamp, ranges[n]) for n, robot in simulated if not robot.hangs("scanner")]
        if not self._profiler.flat and samples(GROUND_HZ):
            heights = self._profiler.profile(poses, self._bodies.standing_m())
            seeing = [(n, robot) for n, robot in simulated if not robot.hangs("driver")]
            sent += [robot.ground(stamp, self._profiler.offsets_m, heights[n]) for n, robot in seeing]
        for name, rate_hz in self._own_sensors.rates_hz.items():
            if samples(rate_hz):
                sent += self._readings(name, stamp)
        if samples(TRUTH_HZ):
            sent.append(self._truth(stamp))
        if samples(CLOCK_HZ):
            clock = Clock(self._truths.header("clock", stamp), self._time.elapsed_s)
            sent.append(self._truths.envelope("clock", clock))
        return sent

    def _readings(self, name: str, stamp: float) -> list[Envelope]:
        """Return what the sensor `name` of each robot measures, and an event for the first that fails."""
        poses, moved = self._bodies.poses, self._bodies.moved()
        robots = {robot.id: pose for robot, pose in zip(self._robots, poses, strict=True)}
        known = dict(enumerate((*self._scenario.world.obstacles, *self._added.new)))
        places = {n: (pose.x, pose.y) for n, pose in moved.items()}
        obstacles = tuple(replace(one, center_m=places.get(n, one.center_m)) for n, one in known.items())
        sent: list[Envelope] = []
        for n, robot in self._simulated:
            if robot.hangs("driver"):
                continue
            twist, way_m = self._bodies.twists[n], robot.odometry.odometer_m
            state = TrueState(robot.id, self._time.elapsed_s, poses[n], twist, way_m, robots, obstacles)
            measured = self._own_sensors.measure(name, state)
            if isinstance(measured, str):
                sent.append(self._event("failed", None, {"robot": robot.id, "reason": measured}, stamp))
            elif measured is not None:
                sent.append(robot.reading(stamp, name, measured))
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
        note = MissionNote(self._outbox.header("mission", now), self._announced)
        return self._outbox.envelope("mission", note)

    def _event(self, kind: str, term: Term | None, data: dict[str, object], stamp: float) -> Envelope:
        return self._outbox.event_envelope(kind, stamp, term, data)


def _gateway_name(robot_id: int) -> str:
    """Return the receiver name of a FENCE in its key."""
    return f"gateway{robot_id}"
