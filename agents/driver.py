"""The moving part of an agent: own pose, who is ahead, what stands in the way, and the twist that follows from it.

One fat decision (`drive`): lead, follow or stand; then round what the scan shows; then the limits. Nothing here
knows of terms or keys.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, hypot, inf, sin
from typing import TYPE_CHECKING

from msgspec import structs

from agents.beliefs import Beliefs
from agents.config import CONTROL_PERIOD_S
from agents.crossing import Crossing
from agents.decisions import Class, Situation, decide
from agents.estimator import Estimator
from agents.features import Feature, Tracker
from agents.following import follower_of, predecessor_of
from agents.formation import Formation
from agents.ground import Ground
from agents.motion import Lead
from agents.perception import Point, Surroundings, free_along, sides, without
from agents.predecessor import Predecessor
from agents.safety import SKIN_M, safe
from agents.strategy import Decision, Detour
from agents.stuck import Stuck
from protocol.geometry import STILL, Pose2D, Twist, bearing, distance, wrap
from protocol.messages import GroundProfile, LaserScan, ObstacleNote, Role, Slot
from protocol.mission import Mission

if TYPE_CHECKING:
    from agents.explore import Explore

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
SWING_S, SWING_SHARE = 10.0, 0.7
"""After an orientation request the leader goes at this share of its cruise speed for so long."""
OBEYED_MPS, OBEYED_RADPS = 0.1, 0.5
"""Wheels that obey are nearer than this to the command: several periods of full acceleration."""
NOSE_M, NOSE_RAD, NOSE_RADPS, NOSE_MPS = 0.05, 0.2, 0.5, 0.1
"""Free way ahead, bearing of the route, and speeds when an explorer's nose is at a wall."""
LOOK_ROUND_M = 0.35
ON_TRACE_M = 0.3
"""Nearer than this to its place on a trace, a follower goes where its predecessor has gone: no detour is better."""
MATE_M = 0.6
"""A thing nearer than this to where a team-mate should be is that team-mate: the table's rows are half a second old."""
OWN_M = 0.15
"""A point nearer than this to the surface of what moves belongs to it."""


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
        self._tracker = Tracker()
        self._detour = Detour(mission.radius_m, mission.limits)
        self._crossing = Crossing()
        self._ground = Ground(mission.limits)
        self._stuck = Stuck(again=mission.leading.motion != "explore")
        self.stuck: str | None = None
        """Why this robot is stuck, None when it is not."""
        self.explore: Explore | None = None
        if mission.leading.motion == "explore":
            from agents.explore import Explore  # a map and a planner: memory that only explorers need

            self.explore = Explore(mission)
        """A map of one's own and the route through it, where the mission asks for it."""
        self._role = Role.WAITING
        self._last = STILL
        self._driven_at: float | None = None
        self._waiting_since: float | None = None
        self._steps = 0
        self._asked: dict[int, float] = {}
        self._swings_until = 0.0

    @property
    def decision(self) -> Decision | None:
        """What is being done about the surroundings, None on the wanted way."""
        return self._crossing.decision or self._detour.decision or self._ground.decision

    @property
    def last(self) -> Twist:
        return self._last

    def published(self, measured: Twist) -> Twist:
        """What a successor is told: the command, which is what the wheels do next, so that no delay is added.

        Where they do not obey (a body in the way, a closed gateway): what they do.
        """
        off_mps, off_radps = self._last.linear_x - measured.linear_x, self._last.angular_z - measured.angular_z
        return self._last if abs(off_mps) < OBEYED_MPS and abs(off_radps) < OBEYED_RADPS else measured

    def see(self, scan: LaserScan, now: float) -> None:
        known = self.estimator.pose_at(now)
        if known is not None:
            pose = known[0]
            self._surroundings.scan(scan, pose, now)
            mates = self._mates(now)
            if self.explore is not None:  # its map tells where it can go: what moves shows there and goes again
                self.explore.see(scan, pose, known[1], mates)
                return
            places = [(mate.x, mate.y) for mate in mates]
            self._tracker.update(self._surroundings.points_map, (pose.x, pose.y), places, MATE_M, now)

    def feel(self, profile: GroundProfile, now: float) -> None:
        """Take a look at the floor ahead."""
        known = self.estimator.pose_at(now)
        if known is not None:
            self._ground.profile(profile, known[0], now)

    def avoid_trap(self, note: ObstacleNote, now: float) -> None:
        """Keep out of a place in which another robot got stuck."""
        self._ground.bar_circle(note.x, note.y, note.radius_m, "wall", now)

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
        points = self._surroundings.points(pose, LOOK_M) + self._ground.points(pose, LOOK_M)
        if self.explore is not None and self.explore.work(role is Role.LEADER, pose, self._mates(now), now):
            self.lead.take(self.explore.route, pose)
        moving = self._beliefs.moving(self._tracker.moving(now), now)
        giving_way = moving and self._crossing.patient
        still = [p for p in points if not _belongs(p, pose, moving)] if giving_way else points
        if role is Role.LEADER:
            wanted = self._leading(chain, still, pose, now)
        elif role is Role.FOLLOWER:
            self._steps += 1
            if self._steps % TRACK_EVERY == 0:
                self.lead.track(pose)
            wanted = self._following(still, pose, twist, dt, now)
        else:
            wanted = STILL
        if role is not Role.WAITING:
            wanted = self._crossing.give_way(moving, pose, wanted, now)
            wanted = self._ground.cross(wanted, self._mission.radius_m, now)
        self._watch(role, pose, wanted, now)
        limits = self._mission.limits
        self._last = safe(wanted, self._last, points, self._mission.radius_m, limits, dt)
        self.follower.overridden(self._last)
        return self._last

    def arrived(self, pose: Pose2D, twist: Twist) -> bool:
        return self._role is Role.LEADER and self.lead.arrived(pose, twist)

    def _change(self, role: Role, pose: Pose2D, twist: Twist) -> None:
        self._role = role
        self._detour.decision = self._crossing.decision = None
        self._waiting_since = None
        self._stuck.reset()
        omega_max = self._mission.limits.omega_max_radps
        self._detour.omega_max_radps = min(LEADER_OMEGA_MAX_RADPS, omega_max) if role is Role.LEADER else omega_max
        if role is Role.LEADER:
            self.lead.begin(pose)
        elif role is Role.FOLLOWER:
            self.follower.rejoin(pose, twist)

    def _watch(self, role: Role, pose: Pose2D, wanted: Twist, now: float) -> None:
        """Whether the robot is stuck on its way; not when it stands where it belongs or waits for its team."""
        rests = role is Role.WAITING or self._waiting_since is not None or self.lead.arrived(pose, self._last)
        if rests:
            self._stuck.reset()
            self.stuck = None
            return
        decision = self.decision
        action = None if decision is None else decision.action
        self.stuck = self._stuck.watch(pose, wanted, action, self.estimator.age_s(now), now)

    def _mates(self, now: float) -> list[Pose2D]:
        """Where the team-mates are, as far as known: the predecessor by its poses, the others by the table."""
        places = [self._beliefs.pose_of(robot, now) for robot in self._mission.robots if robot != self._id]
        if self.predecessor is not None:
            sighting = self.predecessor.at(now)
            places.append(None if sighting is None else sighting.pose)
        return [place for place in places if place is not None]

    def _leading(self, chain: tuple[int, ...], points: list[Point], pose: Pose2D, now: float) -> Twist:
        leading = self._mission.leading
        slots = [] if self.formation.trace else [self.formation.slot_of(robot) for robot in chain[1:]]
        speed = leading.cruise_mps * self._patience(chain, pose, now) * self._swing(slots, now)
        wanted = self.lead.step(pose, self._last, slots, speed)
        if self.explore is not None:
            return self._exploring(points, pose, wanted) if self.explore.route else STILL
        reach = min(LOOK_M, self.lead.remaining_m(pose))
        around = self._steer(points, self.lead.ahead(pose, reach), wanted, 0.7 * speed, pose, now)
        return wanted if around is None else around

    def _swing(self, slots: Sequence[Slot], now: float) -> float:
        """Share of the cruise speed while the formation changes: the last robot's slot swings with all before it."""
        asked = {slot.robot: slot.phi for slot in slots}
        if any(self._asked.get(robot, phi) != phi for robot, phi in asked.items()):
            self._swings_until = now + SWING_S
        self._asked = asked
        return SWING_SHARE if now < self._swings_until else 1.0

    def _exploring(self, points: list[Point], pose: Pose2D, wanted: Twist) -> Twist:
        """Along the planned route; where the nose is at a wall, turned towards the route first, or backed away."""
        half_width_m = self._mission.radius_m + SKIN_M
        if wanted.linear_x <= 0.0 or free_along(points, wanted, half_width_m) > NOSE_M:
            return wanted
        x, y = self.lead.ahead(pose, LOOK_ROUND_M)
        if abs(atan2(y, x)) > NOSE_RAD:
            return Twist(0.0, NOSE_RADPS if y > 0.0 else -NOSE_RADPS)
        return Twist(-NOSE_MPS, 0.0) if free_along(points, Twist(-1.0, 0.0), half_width_m) > NOSE_M else STILL

    def _steer(
        self, points: list[Point], target: Point, wanted: Twist, speed: float, pose: Pose2D, now: float
    ) -> Twist | None:
        """A detour, if one is needed; what it goes round is named once, when it begins."""
        before = self._detour.decision
        around = self._detour.steer(points, target, wanted, speed, now)
        decision = self._detour.decision
        if decision is not None:
            if before is None:
                before = self._classed(decision, points, pose, now)
            named = {"kind": before.kind, "condition": before.condition, "updates": before.updates}
            self._detour.decision = structs.replace(decision, **named)
        return around

    def met(self, pose: Pose2D, kind: str, now: float) -> Feature | None:
        """The nearest thing of class `kind` that this robot itself sees: what it tells the others."""
        return _nearest([f for f in self._tracker.features(now) if f.kind == kind], pose)

    def _classed(self, decision: Decision, points: list[Point], pose: Pose2D, now: float) -> Decision:
        """The decision with the class of the nearest thing, and the row of the table that it falls under."""
        nearest = _nearest(self._tracker.features(now), pose)
        apart_m = inf if nearest is None else hypot(nearest.x - pose.x, nearest.y - pose.y) - nearest.radius_m
        kind: Class = self._ground.kind_near(pose.x, pose.y, apart_m) or (
            "stationary" if nearest is None else nearest.kind
        )
        width_m = 2.0 * nearest.radius_m if nearest is not None else 0.0
        left_m, right_m, rear_m = sides(points)
        row = decide(Situation(kind, decision.free_m, width_m, left_m, right_m, rear_m))
        if row is None:
            return structs.replace(decision, kind=kind)
        return structs.replace(decision, kind=kind, condition=row.name, updates=row.updates)

    def _following(self, points: list[Point], pose: Pose2D, twist: Twist, dt: float, now: float) -> Twist:
        sighting = None if self.predecessor is None else self.predecessor.at(now)
        slot = self.formation.slot_of(self._id)
        wanted = self.follower.step(sighting, slot, pose, twist, dt, on_trace=self.formation.trace)
        if sighting is None or sighting.age_s > CONTROL_PERIOD_S * 25:
            return wanted
        if self.formation.trace and self.follower.readout.error_m < ON_TRACE_M:
            return wanted
        seen = without(points, _in_base(pose, sighting.pose), self._mission.radius_m + 0.1)
        readout = self.follower.readout
        target = _in_base(pose, readout.slot_map)
        speed = min(self._mission.limits.v_max_mps, abs(sighting.twist.linear_x) + CATCH_UP_PER_S * hypot(*target))
        was_detour = self._detour.decision is not None
        around = self._steer(points if was_detour else seen, target, wanted, speed, pose, now)
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


def _nearest(features: Sequence[Feature], pose: Pose2D) -> Feature | None:
    return min(features, key=lambda f: hypot(f.x - pose.x, f.y - pose.y) - f.radius_m, default=None)


def _belongs(point: Point, pose: Pose2D, moving: Sequence[Feature]) -> bool:
    """The point (in `base_link`) is one of what moves."""
    c, s = cos(pose.theta), sin(pose.theta)
    x, y = pose.x + c * point[0] - s * point[1], pose.y + s * point[0] + c * point[1]
    return any(hypot(x - f.x, y - f.y) < f.radius_m + OWN_M for f in moving)


def _in_base(pose: Pose2D, point: Pose2D) -> Point:
    apart, direction = distance(pose, point), wrap(bearing(pose, point) - pose.theta)
    return apart * cos(direction), apart * sin(direction)
