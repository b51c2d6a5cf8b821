"""The moving part of an agent: own pose, who is ahead, what stands in the way, and the twist that follows from it.

One fat decision (`drive`): lead, follow or stand; then round what the scan shows; then the limits. Nothing here
knows of terms or keys.
"""

from __future__ import annotations

from math import cos, hypot, sin

from agents.beliefs import Beliefs
from agents.config import CONTROL_PERIOD_S
from agents.estimator import Estimator
from agents.following import follower_of, predecessor_of
from agents.formation import Formation
from agents.motion import Lead
from agents.perception import Point, Surroundings, without
from agents.predecessor import Predecessor
from agents.safety import safe
from agents.strategy import Decision, Detour
from protocol.geometry import STILL, Pose2D, Twist, bearing, distance, wrap
from protocol.messages import LaserScan, Role
from protocol.mission import Mission

GAP_SLOW = 1.5
GAP_WAIT = 2.2
"""Of k^d: the leader slows, then waits, while a gap of its chain is wider."""
GAP_WAIT_S_MAX = 15.0
CATCH_UP_PER_S = 0.8
LOOK_M = 2.0
LEADER_OMEGA_MAX_RADPS = 0.6
"""A slot at k^d = 1.2 m then swings at 0.7 m/s."""
TRACK_EVERY = 5
"""Control periods between a follower's looks at its place on the route."""
DT_MIN_S = 0.002


class Driver:
    """Of one robot with one mission."""

    def __init__(self, robot_id: int, mission: Mission, beliefs: Beliefs) -> None:
        """Raises `Refused` when the mission's gains or controller cannot be had."""
        self._id = robot_id
        self._mission = mission
        self._beliefs = beliefs
        self.estimator = Estimator()
        self.formation = Formation.of(mission)
        self.follower = follower_of(mission)
        self.lead = Lead(mission.leading, mission.limits)
        self.predecessor: Predecessor | None = None
        self._surroundings = Surroundings()
        self._detour = Detour(mission.radius_m, mission.limits)
        self._role = Role.WAITING
        self._last = STILL
        self._driven_at: float | None = None
        self._waiting_since: float | None = None
        self._steps = 0

    @property
    def decision(self) -> Decision | None:
        """The detour that is being made, None on the wanted way."""
        return self._detour.decision

    @property
    def last(self) -> Twist:
        return self._last

    def see(self, scan: LaserScan, now: float) -> None:
        known = self.estimator.pose_at(now)
        if known is not None:
            self._surroundings.scan(scan, known[0], now)

    def follow_robot(self, robot: int | None, followers: int) -> None:
        """Whose successor this robot is from now on; None for nobody's."""
        current = None if self.predecessor is None else self.predecessor.robot
        if robot != current:
            before = self.predecessor
            self.predecessor = None if robot is None else predecessor_of(self._mission, robot, followers, before)

    def drive(self, role: Role, chain: tuple[int, ...], pose: Pose2D, twist: Twist, now: float) -> Twist:
        """The command for the next control period."""
        dt = CONTROL_PERIOD_S if self._driven_at is None else now - self._driven_at
        dt = min(max(dt, DT_MIN_S), 2.0 * CONTROL_PERIOD_S)
        self._driven_at = now
        if role != self._role:
            self._change(role, pose, twist)
        points = self._surroundings.points(pose, LOOK_M)
        if role is Role.LEADER:
            wanted = self._leading(chain, points, pose, twist, now)
        elif role is Role.FOLLOWER:
            self._steps += 1
            if self._steps % TRACK_EVERY == 0:
                self.lead.track(pose)
            wanted = self._following(points, pose, twist, dt, now)
        else:
            wanted = STILL
        limits = self._mission.limits
        self._last = safe(wanted, self._last, points, self._mission.radius_m, limits, dt)
        self.follower.overridden(self._last)
        return self._last

    def arrived(self, pose: Pose2D, twist: Twist) -> bool:
        return self._role is Role.LEADER and self.lead.arrived(pose, twist)

    def _change(self, role: Role, pose: Pose2D, twist: Twist) -> None:
        self._role = role
        self._detour.decision = None
        self._waiting_since = None
        omega_max = self._mission.limits.omega_max_radps
        self._detour.omega_max_radps = min(LEADER_OMEGA_MAX_RADPS, omega_max) if role is Role.LEADER else omega_max
        if role is Role.LEADER:
            self.lead.begin(pose)
        elif role is Role.FOLLOWER:
            self.follower.rejoin(pose, twist)

    def _leading(self, chain: tuple[int, ...], points: list[Point], pose: Pose2D, twist: Twist, now: float) -> Twist:
        leading = self._mission.leading
        slots = [] if self.formation.trace else [self.formation.slot_of(robot) for robot in chain[1:]]
        speed = leading.cruise_mps * self._patience(chain, pose, now)
        wanted = self.lead.step(pose, self._last, slots, speed)
        reach = min(LOOK_M, self.lead.remaining_m(pose))
        around = self._detour.steer(points, self.lead.ahead(pose, reach), wanted, 0.7 * speed, now)
        return wanted if around is None else around

    def _following(self, points: list[Point], pose: Pose2D, twist: Twist, dt: float, now: float) -> Twist:
        sighting = None if self.predecessor is None else self.predecessor.at(now)
        slot = self.formation.slot_of(self._id)
        wanted = self.follower.step(sighting, slot, pose, twist, dt, on_trace=self.formation.trace)
        if sighting is None or sighting.age_s > CONTROL_PERIOD_S * 25:
            return wanted
        seen = without(points, _in_base(pose, sighting.pose), self._mission.radius_m + 0.1)
        readout = self.follower.readout
        target = _in_base(pose, readout.slot_map)
        speed = min(self._mission.limits.v_max_mps, abs(sighting.twist.linear_x) + CATCH_UP_PER_S * hypot(*target))
        was_detour = self._detour.decision is not None
        around = self._detour.steer(points if was_detour else seen, target, wanted, speed, now)
        if around is None:
            if was_detour:
                self.follower.rejoin(pose, self._last)
            return wanted
        return around

    def _patience(self, chain: tuple[int, ...], pose: Pose2D, now: float) -> float:
        """Share of the cruise speed that lets the team keep up: less while a gap is wide, 0 for a bounded time."""
        ahead: Pose2D | None = pose
        widest = 0.0
        for robot in chain[1:]:
            here = self._beliefs.pose_of(robot, now)
            if here is not None and ahead is not None:
                widest = max(widest, distance(ahead, here) / self.formation.slot_of(robot).separation_m)
            ahead = here
        if widest <= GAP_WAIT:
            self._waiting_since = None
            return 1.0 if widest <= GAP_SLOW else 0.5
        if self._waiting_since is None:
            self._waiting_since = now
        return 0.0 if now - self._waiting_since < GAP_WAIT_S_MAX else 0.5


def _in_base(pose: Pose2D, point: Pose2D) -> Point:
    apart, direction = distance(pose, point), wrap(bearing(pose, point) - pose.theta)
    return apart * cos(direction), apart * sin(direction)
