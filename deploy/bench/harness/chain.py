"""Bare chain of followers: formation, observer and controller, without agents, codec and physics engine.

Virtual time advances in steps of one control period. In each step messages arrive, every robot computes its command
from its own data and publishes (pose, command), then all move along exact arcs. One seed gives all random numbers.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from math import cos, hypot, pi, sin
from random import Random

from msgspec import Struct

from lfa.agents.config import CONTROL_PERIOD_S, Gains
from lfa.agents.following.follower import Follower
from lfa.agents.following.plugin import make_controller
from lfa.agents.following.predecessor import Predecessor
from lfa.agents.formation.pose_history import PoseHistory
from lfa.agents.formation.slot_motion import SlotMotion
from lfa.agents.localization.estimator import Estimator
from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc, bearing, wrap
from lfa.protocol.messages.consensus import NO_TERM, GatewayStamp, Role
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import Localization, Sensors
from lfa.protocol.messages.team import PoseStamped, Slot
from lfa.protocol.mission import Following, Limits

FIX_EVERY = 5
"""Number of control periods between two localisation fixes: 10 Hz."""


class ChainLink(Struct, frozen=True):
    """Link between two robots: latency [s], uniform jitter added to it [s], loss probability."""

    delay_s: float = 0.02
    jitter_s: float = 0.0
    loss: float = 0.0


class Blur(Struct, frozen=True):
    """Standard deviations of localisation noise; with it, robots estimate their poses from odometry and fixes only."""

    fix_m: float = 0.005
    fix_rad: float = 0.5 * pi / 180.0
    dropout: float = 0.1
    odometry: float = 0.01
    """Standard deviation of the wheel speed, as a fraction of the speed."""


class Setup(Struct, frozen=True):
    """Configuration of a chain; `slots` are those of its followers in order."""

    slots: tuple[Slot, ...]
    gains: Gains = Gains()
    limits: Limits = Limits()
    controller: str = "law"
    mode: str = "velocity"
    delay_s: float | None = 0.0
    trace: bool = False
    heading_filter_m: float = 0.0
    cruise_mps: float = 0.5
    extrapolation_max_s: float = 0.5
    link: ChainLink = ChainLink()
    blur: Blur | None = None
    clock_offset_s: float = 0.0
    """Offset [s] of each robot's clock from that of its predecessor."""
    clock_drift: float = 0.0
    """Rate error of every second robot's clock, as a fraction."""
    judged: bool = True
    """True if `Chain.errors` is computed."""
    seed: int = 1


class ChainErrors(Struct, frozen=True):
    """Errors of one follower, from the true poses; control.md section 6 defines each."""

    slot_m: float
    distance_m: float
    bearing_rad: float
    heading_rad: float


class ChainRobot:
    """One follower: its state and estimates, and a second slot computed from the true poses as reference."""

    def __init__(self, setup: Setup, index: int, pose: Pose2D) -> None:
        gains, limits = setup.gains, setup.limits
        self.slot = setup.slots[index]
        self.follower = Follower(
            gains,
            limits,
            make_controller(Following(controller=setup.controller), gains, limits),
            heading_filter_m=setup.heading_filter_m,
            cruise_mps=setup.cruise_mps,
            paper_observer=setup.mode == "paper",
        )
        self.predecessor = Predecessor(
            index + 1,
            mode="pose" if setup.mode == "pose" else "velocity",
            extrapolation_max_s=setup.extrapolation_max_s,
            delay_s=setup.delay_s,
            trace_m=self.slot.separation_m,
        )
        self.true_slot = SlotMotion(gains, limits, setup.heading_filter_m)
        self.true_trace = PoseHistory(self.slot.separation_m + 2.0)
        self.heading = pose.theta
        self.pose = pose
        self.twist = STILL


class Chain:
    """Leader with a given twist in each step, and its followers."""

    def __init__(self, setup: Setup, starts: Sequence[Pose2D] | None = None) -> None:
        """Place the robots at `starts`, the leader first; by default all stand in their slots."""
        self.setup = setup
        self.time_s = 0.0
        self.leader_pose = Pose2D() if starts is None else starts[0]
        self.leader_twist = STILL
        poses = list(starts[1:]) if starts is not None else in_slots(self.leader_pose, setup.slots)
        self.robots = [ChainRobot(setup, index, pose) for index, pose in enumerate(poses)]
        self._chance = Random(setup.seed)
        self._errors: list[ChainErrors] = []
        self._in_flight: list[tuple[float, int, int, PoseStamped]] = []
        self._sent = 0
        self._slots_known = False
        self._knowing = None if setup.blur is None else [Knowing(setup.blur, self._chance) for _ in self.robots]
        self._leader_knowing = None if setup.blur is None else Knowing(setup.blur, self._chance)

    def step(self, leader_twist: Twist) -> None:
        """Advance all robots by one control period; `leader_twist` is in the leader's frame."""
        now, dt = self.time_s, CONTROL_PERIOD_S
        self._deliver(now)
        self.leader_twist = leader_twist
        leader_known = _known(self._leader_knowing, now, self.leader_pose, leader_twist)
        messages = [(leader_known, leader_twist)]
        for index, robot in enumerate(self.robots):
            knowing = None if self._knowing is None else self._knowing[index]
            known = _known(knowing, now, robot.pose, robot.twist)
            local = self._clock(index + 1, now)
            sighting = robot.predecessor.at(local)
            robot.twist = robot.follower.step(sighting, robot.slot, known, robot.twist, dt, on_trace=self.setup.trace)
            messages.append((known, robot.twist))
        self._publish(now, messages)
        if self.setup.judged:
            self._judge(dt)
        self._move(dt)
        self.time_s = now + dt

    def lose(self, index: int) -> ChainRobot:
        """Remove follower `index` and return it; its successor closes the gap. Messages in transit are lost."""
        gone = self.robots.pop(index)
        if index < len(self.robots):
            heir = self.robots[index]
            heir.predecessor = Predecessor(index + 1 + len(self.setup.slots), trace=heir.predecessor.trace)
        self._in_flight.clear()
        return gone

    def errors(self, index: int) -> ChainErrors:
        """Return the errors of follower `index` (from 0) before the last move."""
        return self._errors[index]

    def _judge(self, dt: float) -> None:
        ahead_pose, ahead_twist = self.leader_pose, self.leader_twist
        self._errors = []
        for robot in self.robots:
            slot = robot.true_slot
            if not self._slots_known:
                slot.reset(robot.slot, ahead_pose)
            if self.setup.trace:
                travelled_m = robot.true_trace.add(ahead_pose)
                slot.step_on(robot.true_trace, travelled_m, robot.slot, ahead_pose, ahead_twist.linear_x, dt)
            else:
                slot.step(robot.slot, ahead_pose, ahead_twist, dt)
            if hypot(slot.vx, slot.vy) > 0.05:
                sign = -1.0 if ahead_twist.linear_x < 0.0 else 1.0
                robot.heading = bearing(Pose2D(), Pose2D(sign * slot.vx, sign * slot.vy))
            pose = robot.pose
            apart = hypot(pose.x - ahead_pose.x, pose.y - ahead_pose.y)
            side = bearing(ahead_pose, Pose2D(slot.x, slot.y))
            commanded_m = hypot(slot.x - ahead_pose.x, slot.y - ahead_pose.y)
            self._errors.append(
                ChainErrors(
                    hypot(slot.x - pose.x, slot.y - pose.y),
                    apart - commanded_m,
                    wrap(bearing(ahead_pose, pose) - side),
                    wrap(robot.heading - pose.theta),
                )
            )
            ahead_pose, ahead_twist = robot.pose, robot.twist
        self._slots_known = True

    def _move(self, dt: float) -> None:
        if self._leader_knowing is not None and self._knowing is not None:
            self._leader_knowing.drove(self.leader_twist, dt)
            for knowing, robot in zip(self._knowing, self.robots, strict=True):
                knowing.drove(robot.twist, dt)
        self.leader_pose = along_arc(self.leader_pose, self.leader_twist, dt)
        for robot in self.robots:
            robot.pose = along_arc(robot.pose, robot.twist, dt)

    def _clock(self, place: int, now: float) -> float:
        """Return the clock reading [s] of the robot at `place` in the chain."""
        return now * (1.0 + self.setup.clock_drift * (place % 2)) + self.setup.clock_offset_s * place

    def _publish(self, now: float, known: list[tuple[Pose2D, Twist]]) -> None:
        link, chance = self.setup.link, self._chance
        for index in range(len(self.robots)):
            if link.loss > 0.0 and chance.random() < link.loss:
                continue
            pose, twist = known[index]
            header = Header(f"robot{index + 1}", 1, 0, self._clock(index, now))
            message = PoseStamped(header, pose.x, pose.y, 0.0, pose.theta, twist, 0.0, Role.FOLLOWER, NO_TERM)
            arrives = now + link.delay_s
            if link.jitter_s > 0.0:
                arrives += chance.random() * link.jitter_s
            self._sent += 1
            heapq.heappush(self._in_flight, (arrives, self._sent, index, message))

    def _deliver(self, now: float) -> None:
        in_flight, delay_s = self._in_flight, self.setup.link.delay_s
        while in_flight and in_flight[0][0] <= now + 1e-9:
            arrived, _, index, message = heapq.heappop(in_flight)
            predecessor = self.robots[index].predecessor
            local = self._clock(index + 1, arrived)
            predecessor.heard(message, local)
            # The reverse link has the same delay: the predecessor reports the arrival of this robot's messages.
            predecessor.clock.reported(self._clock(index, arrived + delay_s) - self._clock(index + 1, arrived), local)


class Knowing:
    """Simulated odometry and localisation of one robot, and the pose estimator that uses them."""

    def __init__(self, blur: Blur, chance: Random) -> None:
        self._blur = blur
        self._chance = chance
        self._estimator = Estimator()
        self._odometry = Pose2D()
        self._odometer_m = 0.0
        self._ticks = 0

    def drove(self, twist: Twist, dt: float) -> None:
        """Update the noisy odometry with the true `twist` over `dt` [s]."""
        blur, gauss = self._blur, self._chance.gauss
        v = twist.linear_x * (1.0 + gauss(0.0, blur.odometry))
        omega = twist.angular_z * (1.0 + gauss(0.0, blur.odometry))
        self._odometry = along_arc(self._odometry, Twist(v, omega), dt)
        self._odometer_m += abs(v) * dt

    def pose(self, now: float, true: Pose2D, twist: Twist) -> Pose2D:
        """Update the estimator with odometry and, when due, a noisy fix of `true`; return the estimated pose."""
        blur, gauss = self._blur, self._chance.gauss
        header = Header("driver", 1, self._ticks, now)
        stamp = GatewayStamp(1, now)
        self._estimator.sensors(Sensors(header, self._odometry, twist, self._odometer_m, stamp, NO_TERM), now)
        first = self._estimator.pose_at(now) is None
        if first or (self._ticks % FIX_EVERY == 0 and self._chance.random() >= blur.dropout):
            fix = Pose2D(
                true.x + gauss(0.0, blur.fix_m),
                true.y + gauss(0.0, blur.fix_m),
                wrap(true.theta + gauss(0.0, blur.fix_rad)),
            )
            self._estimator.localization(Localization(header, fix), now)
        self._ticks += 1
        known = self._estimator.pose_at(now)
        assert known is not None
        return known[0]


def in_slots(leader: Pose2D, slots: Sequence[Slot]) -> list[Pose2D]:
    """Return the poses of followers that stand in their slots, all with the leader's heading."""
    poses = []
    for slot in slots:
        angle = leader.theta + slot.phi
        x, y = leader.x + slot.separation_m * cos(angle), leader.y + slot.separation_m * sin(angle)
        leader = Pose2D(x, y, leader.theta)
        poses.append(leader)
    return poses


def _known(knowing: Knowing | None, now: float, true: Pose2D, twist: Twist) -> Pose2D:
    return true if knowing is None else knowing.pose(now, true, twist)
