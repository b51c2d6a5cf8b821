"""What the sensors of the simulated robots measure, each at its own rate on the world's time grid."""

from __future__ import annotations

from collections.abc import Sequence

from msgspec.structs import replace

from lfa.protocol.node import Envelope
from lfa.protocol.outbox import Outbox
from lfa.protocol.topics import TOPIC
from lfa.world.added_obstacles import AddedObstacles
from lfa.world.description.own_sensor import TrueState
from lfa.world.description.scenario import Obstacle, Scenario
from lfa.world.physics.kinematics import Kinematic
from lfa.world.physics.rigid_bodies import Physics
from lfa.world.robot_hardware import RobotHardware
from lfa.world.sensors.ground_sensor import Profiler
from lfa.world.sensors.lidar import Scanner
from lfa.world.sensors.own_sensors import OwnSensors
from lfa.world.time_grid import TimeGrid

FIX_HZ, GROUND_HZ = (TOPIC[topic].rate_hz or 0.0 for topic in ("localization", "ground"))
"""Rates [Hz] of the sensors whose rate is no choice of the scenario's."""


class SimulatedSensors:
    """Sensors of the drawn `scenario`, with the obstacles `added` to it; `seed` draws the noise of own sensors.

    An own sensor that fails is told once, by an event in the world's `outbox`. Raises RefusedValue as OwnSensors does.
    """

    def __init__(self, scenario: Scenario, seed: int, added: AddedObstacles, outbox: Outbox) -> None:
        self._scenario = scenario
        self._added = added
        self._outbox = outbox
        self._scanner = Scanner(scenario)
        self._sees = scenario.world.lidar.fitted
        self._profiler = Profiler(scenario)
        self._own_sensors = OwnSensors(scenario, seed, scenario.mission.robots)

    def set_down(self, obstacle: Obstacle) -> None:
        """Let the scanners see an obstacle that was added during the run."""
        self._scanner.set_down(obstacle)

    def measure(
        self,
        stamp: float,
        now: float,
        grid: TimeGrid,
        bodies: Physics | Kinematic,
        robots: Sequence[tuple[int, RobotHardware]],
    ) -> list[Envelope]:
        """Return the messages that are due at this point of the `grid`, stamped with its time `stamp` [s].

        `robots` are the simulated ones, each with its index among the `bodies`. Parts of them that hang are silent.
        """
        sent: list[Envelope] = []
        poses, samples = bodies.poses, grid.samples
        if samples(self._scenario.mission.control_hz):
            driven = _driven(robots)
            sent += [robot.sensors(stamp, now) for _, robot in driven]
            sent += [rests for _, robot in driven if (rests := robot.come_to_rest(now)) is not None]
        if samples(FIX_HZ):
            fixes = (robot.localization(stamp, poses[n]) for n, robot in robots if not robot.hangs("localization"))
            sent += [fix for fix in fixes if fix is not None]
        if self._sees and samples(self._scenario.world.lidar.rate_hz):
            ranges = self._scanner.scan(poses, bodies.moved())
            sent += [robot.scan(stamp, ranges[n]) for n, robot in robots if not robot.hangs("scanner")]
        if not self._profiler.flat and samples(GROUND_HZ):
            heights = self._profiler.profile(poses, bodies.standing_m())
            sent += [robot.ground(stamp, self._profiler.offsets_m, heights[n]) for n, robot in _driven(robots)]
        for name, rate_hz in self._own_sensors.rates_hz.items():
            if samples(rate_hz):
                sent += self._readings(name, stamp, grid.elapsed_s, bodies, _driven(robots))
        return sent

    def _readings(
        self,
        name: str,
        stamp: float,
        elapsed_s: float,
        bodies: Physics | Kinematic,
        robots: Sequence[tuple[int, RobotHardware]],
    ) -> list[Envelope]:
        """Return what the sensor `name` of each robot measures, and an event for the first that fails."""
        poses, moved = bodies.poses, bodies.moved()
        robot_poses = dict(zip(self._scenario.mission.robots, poses, strict=True))
        known = dict(enumerate((*self._scenario.world.obstacles, *self._added.new)))
        places = {n: (pose.x, pose.y) for n, pose in moved.items()}
        obstacles = tuple(replace(one, center_m=places.get(n, one.center_m)) for n, one in known.items())
        sent: list[Envelope] = []
        for n, robot in robots:
            twist, way_m = bodies.twists[n], robot.odometry.odometer_m
            state = TrueState(robot.id, elapsed_s, poses[n], twist, way_m, robot_poses, obstacles)
            measured = self._own_sensors.measure(name, state)
            if isinstance(measured, str):
                reason: dict[str, object] = {"robot": robot.id, "reason": measured}
                sent.append(self._outbox.event_envelope("failed", stamp, None, reason))
            elif measured is not None:
                sent.append(robot.reading(stamp, name, measured))
        return sent


def _driven(robots: Sequence[tuple[int, RobotHardware]]) -> list[tuple[int, RobotHardware]]:
    """Return those of `robots` whose driver does not hang."""
    return [(n, robot) for n, robot in robots if not robot.hangs("driver")]
