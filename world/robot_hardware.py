"""Hardware of one simulated robot: its gateway, its sensors, and the messages they publish."""

from __future__ import annotations

from math import atan2

from lfa.protocol.fleet_stop.answers import StopAnswers
from lfa.protocol.geometry import Pose2D, Twist, wrap
from lfa.protocol.lease.gateway import Gateway
from lfa.protocol.lease.timing import timing_for
from lfa.protocol.messages.consensus import Fence, LeaseNote, Term
from lfa.protocol.messages.robot import (
    CmdVel,
    Contact,
    GroundProfile,
    LaserScan,
    Localization,
    SensorReading,
)
from lfa.protocol.messages.stop import StopOrder
from lfa.protocol.names import robot_name
from lfa.protocol.node import Envelope
from lfa.protocol.outbox import Outbox
from lfa.protocol.topics import TO_ALL, WORLD_NAME
from lfa.world.description.scenario import Scenario
from lfa.world.sensors.lidar import Floats
from lfa.world.sensors.lidar_mount import seen_from_base
from lfa.world.sensors.noise import HeightNoise, Localizer, RangeNoise, WheelOdometry

PARTS = ("driver", "localization", "scanner")
"""Parts of a robot that can hang."""
REFUSAL_EVERY_S = 0.2
"""Minimum interval [s] between two refusal events of a gateway for the same reason, also across terms."""


class RobotHardware:
    """Gateway and sensors between an agent and its simulated body. `now` is the world's monotonic time [s]."""

    def __init__(self, fleet: str, robot_id: int, scenario: Scenario, seed: int, incarnation: int, now: float) -> None:
        noise, mission = scenario.world.noise, scenario.mission
        self.id = robot_id
        self.name = robot_name(robot_id)
        self.gateway = Gateway(
            robot_id,
            incarnation,
            timing_for(mission),
            now,
            mission.limits,
            mission.operator_timeout_s,
        )
        self.odometry = WheelOdometry(noise, seed, robot_id)
        self._localizer = Localizer(noise, seed, robot_id)
        self._range_noise = RangeNoise(noise, scenario.world.lidar, seed, robot_id)
        self._height_noise = HeightNoise(noise, seed, robot_id)
        self._lidar, self._ground = scenario.world.lidar, scenario.world.ground
        self._outbox = Outbox(fleet, WORLD_NAME, incarnation, self.name, first=1)
        self._gateway_outbox = Outbox(fleet, self.name, incarnation, first=1)
        self._answers = StopAnswers(self._outbox)
        self._hung: dict[str, Twist] = {}
        """Parts that hang, and the twist at which the wheels were when each began to."""
        self._refused_at: dict[str, tuple[Term, float]] = {}

    def hang(self, part: str, now: float) -> None:
        """Let the `driver`, the `localization` or the `scanner` hang, as a process does: silent, and without effect."""
        self._hung.setdefault(part, self.gateway.twist(now))

    def resume(self, part: str) -> None:
        """End the hang of `part`."""
        self._hung.pop(part, None)

    def hangs(self, part: str) -> bool:
        """Return whether `part` hangs; with the driver hang all parts, which it reads."""
        return part in self._hung or "driver" in self._hung

    def twist(self, now: float) -> Twist:
        """Return the twist that the motors are commanded: the gateway's, or the last one of a driver that hangs."""
        return self._hung.get("driver") or self.gateway.twist(now)

    def command(self, cmd: CmdVel, now: float) -> tuple[str, dict[str, object]] | None:
        """Pass `cmd` to the gateway; return kind and data of an event for an obeyed leader command or a new refusal."""
        reason = self.gateway.command(cmd, now)
        if reason is None:
            return ("leader_command", {"robot": self.id}) if cmd.as_leader else None
        term, at = self._refused_at.get(reason, (None, float("-inf")))
        if cmd.term == term or now - at < REFUSAL_EVERY_S:
            return None
        self._refused_at[reason] = cmd.term, now
        return "refused", {"robot": self.id, "reason": reason, "count": self.gateway.refused[reason]}

    def fence(self, fence: Fence, now: float) -> Envelope:
        """Fence the gateway and return its FENCED, addressed to all (lease.md section 5)."""
        note = LeaseNote(self._gateway_outbox.header("lease", now), self.gateway.fence(fence, now))
        return self._gateway_outbox.envelope("lease", note, TO_ALL)

    def order(self, order: StopOrder, now: float) -> Envelope:
        """Obey an operator's stop or resume, and return the answer."""
        self.gateway.stop.order(order, now)
        return self._answers.answer(self.gateway.stop, self.odometry.twist, now)

    def come_to_rest(self, now: float) -> Envelope | None:
        """Return the message that the wheels of this stopped robot rest, once after they have come to rest."""
        return self._answers.at_rest(self.gateway.stop, self.odometry.twist, now)

    def sensors(self, stamp: float, now: float) -> Envelope:
        """Return the odometry as of `stamp`, with the gateway's stamp of `now`."""
        odometry, header = self.odometry, self._outbox.header("sensors", stamp)
        message = self.gateway.sensors(header, odometry.pose_odom, odometry.twist, odometry.odometer_m, now)
        odometry.redraw()
        return self._outbox.envelope("sensors", message)

    def localization(self, stamp: float, pose_map: Pose2D) -> Envelope | None:
        """Return a localisation fix of the true `pose_map`, or None if it drops out."""
        fix = self._localizer.fix(pose_map)
        if fix is None:
            return None
        return self._outbox.envelope("localization", Localization(self._outbox.header("localization", stamp), fix))

    def scan(self, stamp: float, ranges: Floats) -> Envelope:
        """Return the scan that this robot's scanner measures from the exact `ranges` [m], one per beam."""
        lidar = self._lidar
        seen = seen_from_base(self._range_noise.apply(ranges), lidar)
        limits = lidar.range_min_m, seen.range_max_m
        message = LaserScan(self._outbox.header("scan", stamp), seen.angle_min, seen.step, *limits, seen.ranges_m)
        return self._outbox.envelope("scan", message)

    def ground(self, stamp: float, offsets_m: tuple[float, ...], heights: Floats) -> Envelope:
        """Return the ground profile measured from the exact `heights` [m], one row per line at `offsets_m`."""
        message = GroundProfile(
            self._outbox.header("ground", stamp),
            self._ground.first_m,
            self._ground.increment_m,
            offsets_m,
            self._height_noise.apply(heights),
        )
        return self._outbox.envelope("ground", message)

    def reading(self, stamp: float, sensor: str, values: dict[str, float]) -> Envelope:
        """Return the message of what a sensor of a user's own has measured."""
        return self._outbox.envelope("reading", SensorReading(self._outbox.header("reading", stamp), sensor, values))

    def contact(self, stamp: float, pose_map: Pose2D, x: float, y: float) -> Envelope:
        """Return the message of a bumper contact at (x, y) in `map`, as a bearing in `base_link`."""
        bearing = wrap(atan2(y - pose_map.y, x - pose_map.x) - pose_map.theta)
        return self._outbox.envelope("contact", Contact(self._outbox.header("contact", stamp), bearing))
