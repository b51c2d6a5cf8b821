"""Motion of one agent: own pose, predecessor, obstacles, and the twist that follows from them.

One function decides (`drive`): lead, follow or stand; then avoid the obstacles of the scan; then apply the limits.
Terms and keys may not be used here.
"""

from __future__ import annotations

from functools import partial
from math import cos, hypot, inf, pi, sin
from typing import TYPE_CHECKING

from lfa.agents.avoidance.decision import Action, Decision
from lfa.agents.avoidance.detour import Detour
from lfa.agents.avoidance.ground_crossing import GroundCrossing
from lfa.agents.avoidance.moving_obstacle import Crossing, before, shadow
from lfa.agents.avoidance.safety import safe, sharing
from lfa.agents.config import CONTROL_PERIOD_S
from lfa.agents.following.factory import follower_of, predecessor_of
from lfa.agents.following.predecessor import Predecessor
from lfa.agents.formation.formation import Formation
from lfa.agents.leading.free_slot import FreeSlot
from lfa.agents.leading.hand_driving import HandDriving
from lfa.agents.leading.leader import LEADER_OMEGA_MAX_RADPS, Leadership
from lfa.agents.leading.narrow_gap import narrow_gap_m
from lfa.agents.leading.path_follower import PathFollower
from lfa.agents.localization.estimator import Estimator
from lfa.agents.perception.obstacle import ON_THE_MAP
from lfa.agents.perception.obstacle_model import ObstacleModel, resting
from lfa.agents.perception.obstacle_tracker import Feature
from lfa.agents.perception.scan import Point, without
from lfa.agents.perception.scan_age import LOST_S, ScanAge
from lfa.agents.recovery.back_up import BackUp
from lfa.agents.recovery.stuck_detector import NEVER_PLACED_S, POSE_LOST_S, SCAN_LOST, StuckMonitor
from lfa.agents.team_state import TeamState
from lfa.protocol.geometry import STILL, Pose2D, Twist, in_base, slowed
from lfa.protocol.messages.consensus import Role
from lfa.protocol.messages.robot import GroundProfile, LaserScan
from lfa.protocol.messages.team import ObstacleNote, RouteProgress
from lfa.protocol.mission import Mission

if TYPE_CHECKING:
    from lfa.agents.exploration.explorer import Explore
    from lfa.agents.leading.way_back import WayBack

CATCH_UP_PER_S = 0.8
DT_MIN_S = 0.002
OBEYED_MPS, OBEYED_RADPS = 0.1, 0.5
"""Maximum difference between command and measured twist while the wheels obey: several periods of full acceleration."""
SLOT_AHEAD_S, SLOT_AHEAD_SHARE = 2.0, 0.4
"""Time [s] by which the target of a follower's detour is ahead on its slot's motion, and the share of k^d that limits
this distance: farther ahead the predecessor would block the way."""
ON_TRACE_M = 0.3
"""Distance [m] to its place on a trace below which a follower makes no detour: its predecessor's path is better."""
BESIDE_SLOT_SHARE = 0.45
"""Distance of a place beside a slot that is taken, as a share of k^d, at most; it still counts as in its slot."""
FRESH_S = 0.5
BEFORE_S = 0.5
"""Time [s] ahead for which the robot brakes before what comes towards it."""
ROUND_TRAP = Decision(Action.PLAN_ROUND, inf, 0.0, "wall", "no local way leads on", "angle")
"""Decision of a leader whose detour leads nowhere, for the log."""
WAY_BACK = Decision(Action.PLAN_ROUND, inf, 0.0, "wall", "the slot is out of reach of a detour", "angle")
"""Decision of a follower that plans its way back to its slot."""


class Navigator:
    """Motion of one robot with one mission."""

    def __init__(self, robot_id: int, mission: Mission, team: TeamState) -> None:
        """Create a navigator. Raise `Refused` when the mission's gains or controller are invalid."""
        self._id = robot_id
        self._mission = mission
        self._team = team
        self.estimator = Estimator()
        self.formation = Formation.of(mission)
        self.follower = follower_of(mission)
        self.leading = Leadership(mission, self.formation, team)
        self.predecessor: Predecessor | None = None
        self._obstacles = ObstacleModel(mission.radius_m, mission.limits, team.obstacles)
        self._ground_crossing = GroundCrossing(self._obstacles.ground, mission.limits, mission.radius_m)
        self.scan_age = ScanAge()
        self._detour = Detour(mission.radius_m, mission.limits)
        self._crossing = Crossing(mission.radius_m)
        self._free_slot = FreeSlot(mission.radius_m)
        self._way_back: WayBack | None = None
        """Way back to the slot; None before this follower has lost it for the first time."""
        self._stuck_monitor = StuckMonitor(again=mission.leading.motion != "explore")
        self._back_up_path = BackUp()
        self._role = Role.WAITING
        self._last = STILL
        self._driven_at: float | None = None
        self._placeless_since: float | None = None
        self.hand_driving = HandDriving()
        self._was_by_hand = False
        self.was_placed = False
        """True once the robot has had a pose."""

    @property
    def lead(self) -> PathFollower:
        return self.leading.lead

    @property
    def explore(self) -> Explore | None:
        """Map and route of an explorer, where the mission requires them; otherwise None."""
        return self.leading.explore

    @property
    def stuck(self) -> str | None:
        """Reason why this robot is stuck; None when it is not."""
        return self._stuck_monitor.reason

    def change(self, mission: Mission, route: int, now: float) -> None:
        """Go on with a mission that an operator has changed; `route`: version of the order that gave its route."""
        new_route = route != self._team.route
        self._mission = mission
        self.leading = Leadership(mission, self.formation, self._team)
        if new_route:
            self._team.route, self._team.progress = route, None
        known = self.estimator.pose_at(now)
        if self._role is Role.LEADER and known is not None:
            # On a new route nothing has been driven yet, whatever the odometer says.
            self.leading.begin(known[0], 0.0 if new_route else self.estimator.odometer_m, now)
            self._stuck_monitor.begin(leading=True)

    def lost_input(self, now: float) -> str | None:
        """Return the input of the robot's own hardware that is too old to drive by; None when all is well."""
        missing = self.estimator.missing(now)
        if missing is not None:
            return missing
        if self.estimator.unfixed:
            return "localization"
        return "scan" if self.scan_age.lost(now) else None

    @property
    def pose_lost(self) -> bool:
        """True while the robot is stuck because it has no pose (S6)."""
        return self._stuck_monitor.pose_lost

    @property
    def decision(self) -> Decision | None:
        """Present avoidance decision; None on the wanted motion."""
        return self._crossing.decision or self._detour.decision or self._ground_crossing.decision

    @property
    def last(self) -> Twist:
        return self._last

    @property
    def _catches_up(self) -> bool:
        """True on a planned way back to the slot."""
        return self._way_back is not None and self._way_back.way is not None

    def published(self, measured: Twist) -> Twist:
        """Return the twist to publish: the command, which the wheels follow next, so that no delay is added.

        Return the measured twist where the wheels do not obey (an obstacle in contact, a closed gateway).
        """
        off_mps, off_radps = self._last.linear_x - measured.linear_x, self._last.angular_z - measured.angular_z
        return self._last if abs(off_mps) < OBEYED_MPS and abs(off_radps) < OBEYED_RADPS else measured

    def see(self, scan: LaserScan, now: float) -> None:
        """Update with a scan; one that only repeats the last counts as none."""
        known = self.estimator.pose_at(now)
        if known is not None and self.scan_age.update(scan, known[0], now):
            mates = self._mates(now)
            self._obstacles.see(scan, known[0], mates, now)
            self.leading.see(scan, known[0], known[1], mates)
            if self._way_back is not None:
                self._way_back.see(scan, known[0], known[1], mates)

    def update_ground(self, profile: GroundProfile, now: float) -> None:
        """Update the ground map with a profile of the floor ahead."""
        known = self.estimator.pose_at(now)
        if known is not None:
            self._obstacles.update_ground(profile, known[0], now)

    def avoid_trap(self, note: ObstacleNote, now: float) -> None:
        """Keep out of a place in which another robot got stuck."""
        self._bar((note.x, note.y), now)

    def _bar(self, trap: Point, now: float) -> None:
        """Block `trap` from now on, except for an explorer: it plans on its map, and would be enclosed in a corner."""
        if self._mission.leading.motion != "explore":
            self._obstacles.avoid_trap(*trap, now)

    def back_out(self, pose: Pose2D) -> None:
        """Start backing out of the place in which the robot is stuck."""
        if self.stuck is not None and not self._back_up_path.under_way:
            self._back_up_path.begin(pose)
            self._stuck_monitor.backing_out = True

    def nearest(self, pose: Pose2D, kind: str, now: float) -> Feature | None:
        """Return the nearest obstacle of class `kind` that this robot itself sees, for its report to the others."""
        return self._obstacles.nearest(pose, kind, now)

    def follow_robot(self, robot: int | None, followers: int) -> None:
        """Set the robot whose successor this robot is from now on; None for no predecessor."""
        current = None if self.predecessor is None else self.predecessor.robot
        if robot != current:
            before = self.predecessor
            self.predecessor = None if robot is None else predecessor_of(self._mission, robot, followers, before)

    def hold(self, now: float) -> Twist:
        """Return the command of a control step without a pose: brake along the path."""
        if self._placeless_since is None:
            self._placeless_since = now
        missing = self.estimator.missing(now)
        patience_s = POSE_LOST_S if self.was_placed else NEVER_PLACED_S
        if missing is not None and now - self._placeless_since >= patience_s:
            self._stuck_monitor.lose_pose(missing)
        self._driven_at = now
        self._detour.decision = self._crossing.decision = None
        limits = self._mission.limits
        self._last = safe(STILL, self._last, (), self._mission.radius_m, limits, CONTROL_PERIOD_S)
        self.follower.overridden(self._last)
        return self._last

    def drive(self, role: Role, chain: tuple[int, ...], pose: Pose2D, twist: Twist, now: float) -> Twist:
        """Return the command for the next control period."""
        dt = CONTROL_PERIOD_S if self._driven_at is None else now - self._driven_at
        dt = min(max(dt, DT_MIN_S), 2.0 * CONTROL_PERIOD_S)
        self._driven_at = now
        self._stuck_monitor.find_pose()
        if self._placeless_since is not None and self.was_placed:
            self.follower.rejoin(pose, twist)
        self._placeless_since, self.was_placed = None, True
        if role != self._role:
            self._change(role, pose, twist, now)
        points = self._obstacles.points(pose)
        self.leading.work(role is Role.LEADER, pose, self._mates, now)
        moving = self._obstacles.moving(pose, now)
        still = resting(points, pose, moving) if self._crossing.patient else points + shadow(moving, pose)
        if role is Role.LEADER:
            by_hand = self._by_hand(pose, now)
            wanted = self._lead(chain, still, pose, now) if by_hand is None else by_hand
        elif role is Role.FOLLOWER:
            wanted = self._follow(still, pose, twist, dt, now)
            wanted = self._back_out(points, pose, wanted, now) if self._back_up_path.under_way else wanted
        else:
            wanted = STILL
        if role is not Role.WAITING:
            wanted = self._crossing.give_way(moving, pose, wanted, now, still)
            wanted = self._ground_crossing.cross(wanted, now)
            wanted = sharing(wanted, self._strangers(pose, now), self._mission.radius_m, self._mission.limits)
            usual_mps = self._mission.leading.cruise_mps if role is Role.LEADER else self._mission.limits.v_max_mps
            wanted = slowed(self.scan_age.limited(wanted, now), self.scan_age.speed_max_mps(usual_mps))
            wanted = self.estimator.limited(wanted)
        if not self._back_up_path.under_way:
            self._back_up_path.keep(pose)
        self._watch(role, pose, wanted, now)
        limits = self._mission.limits
        braked_for = points + self._obstacles.ground.doubtful(pose) + before(moving, pose, BEFORE_S)
        self._last = safe(wanted, self._last, braked_for, self._mission.radius_m, limits, dt)
        self.follower.overridden(self._last)
        if role is Role.LEADER:
            progress = self.lead.progress(pose, self._last)
            self._team.progress = RouteProgress(progress.waypoint, progress.to_m, self._team.route)
        return self._last

    def narrow_ahead(self, pose: Pose2D) -> str | None:
        """Return the reason why only a column passes what is ahead of this leader; None when more do."""
        if self.leading.rounding:
            return "way round a trap"
        gap_m = narrow_gap_m(self._obstacles.points(pose), partial(self.lead.ahead, pose), self._mission.radius_m)
        return None if gap_m is None else f"gap of {gap_m:.1f} m"

    def arrived(self, pose: Pose2D, twist: Twist) -> bool:
        return self._role is Role.LEADER and self.lead.arrived(pose, twist)

    def _change(self, role: Role, pose: Pose2D, twist: Twist, now: float) -> None:
        self._role = role
        self._detour.decision = self._crossing.decision = None
        if self._way_back is not None:
            self._way_back.end()
        self._stuck_monitor.begin(leading=role is Role.LEADER)
        omega_max = self._mission.limits.omega_max_radps
        self._detour.omega_max_radps = min(LEADER_OMEGA_MAX_RADPS, omega_max) if role is Role.LEADER else omega_max
        if role is Role.LEADER:
            self.leading.begin(pose, self.estimator.odometer_m, now)
        elif role is Role.FOLLOWER:
            self.follower.rejoin(pose, twist)

    def _watch(self, role: Role, pose: Pose2D, wanted: Twist, now: float) -> None:
        """Update the stuck monitor; the robot cannot be stuck when it has arrived or waits for its team."""
        waits = role is Role.LEADER and self.leading.waiting
        if role is Role.WAITING or waits or self._was_by_hand or self.arrived(pose, self._last):
            self._stuck_monitor.rest(pose, now)
            return
        decision = self.decision
        action = None if decision is None else decision.action
        leads = role is Role.LEADER and self.leading.under_way
        lost = SCAN_LOST if self.scan_age.age_s(now) > LOST_S else None
        self._stuck_monitor.watch(
            pose, wanted, action, lost, now, leads=leads, again=not (self.leading.rounding or self._catches_up)
        )

    def _mates(self, now: float) -> list[Pose2D]:
        """Return the known poses of the team-mates: the predecessor's from its pose messages, the others' from the
        table.
        """
        places = [self._team.pose_of(robot, now) for robot in self._mission.robots if robot != self._id]
        if self.predecessor is not None:
            sighting = self.predecessor.at(now)
            places.append(None if sighting is None else sighting.pose)
        return [place for place in places if place is not None]

    def _strangers(self, pose: Pose2D, now: float) -> list[Point]:
        """Return the team-mates that this robot does not follow, in `base_link`: no controller keeps a distance to
        them.
        """
        ahead = None if self.predecessor is None else self.predecessor.robot
        c, s, mates = cos(pose.theta), sin(pose.theta), []
        for robot in self._mission.robots:
            place = None if robot in (self._id, ahead) else self._team.pose_of(robot, now)
            if place is not None:
                dx, dy = place.x - pose.x, place.y - pose.y
                mates.append((c * dx + s * dy, c * dy - s * dx))
        return mates

    def _by_hand(self, pose: Pose2D, now: float) -> Twist | None:
        """Return the twist of an operator who drives this leader; None for the route, on which it begins anew then."""
        twist = self.hand_driving.wanted(self._mission.limits, now)
        if twist is not None:
            self._detour.decision = None
        elif self._was_by_hand:
            self.leading.begin(pose, self.estimator.odometer_m, now)
        self._was_by_hand = twist is not None
        return twist

    def _lead(self, chain: tuple[int, ...], points: list[Point], pose: Pose2D, now: float) -> Twist:
        around_these = self.leading.look(points, pose, now)
        wanted, speed = self.leading.step(chain, pose, self._last, now)
        planned = self.leading.planned(points, pose, wanted, self._last, self._detour.decision, now)
        if planned is not None:
            if self.leading.rounding:
                self._detour.decision = ROUND_TRAP
            return planned
        around = self._steer(around_these, self.leading.target(pose), wanted, speed, pose, now)
        return wanted if around is None else around

    def _catch_up(self, slot: Point, points: list[Point], pose: Pose2D, now: float) -> Twist | None:
        """Return the twist of a planned way back to `slot` in `map`; None while the follower needs none."""
        decision = self._detour.decision
        hindered = self.stuck is not None or (decision is not None and decision.kind in ON_THE_MAP)
        if self._way_back is None:
            if not hindered:
                return None
            # Imported here: only a follower that meets an obstacle pays the memory.
            from lfa.agents.leading.way_back import WayBack

            self._way_back = WayBack(self._mission)
        way = self._way_back
        was_back = way.way is not None
        explore = self.leading.explore
        way.watch(slot, pose, hindered, None if explore is None else explore.mapping, now)
        twist = way.steer(points, pose, slot, self._mates, self._last, now)
        if twist is not None:
            self._detour.decision = WAY_BACK
        elif was_back:
            self._detour.decision = None
            self.follower.rejoin(pose, self._last)
        return twist

    def _steer(
        self, points: list[Point], target: Point, wanted: Twist, speed: float, pose: Pose2D, now: float
    ) -> Twist | None:
        """Return the twist of a detour; None if none is needed."""
        return self._detour.steer(
            points, target, wanted, speed, now, lambda free_m: self._obstacles.blocking(pose, wanted, free_m, now)
        )

    def _back_out(self, points: list[Point], pose: Pose2D, wanted: Twist, now: float) -> Twist:
        """Return the twist backwards out of a trap, then block the trap; `wanted` once the robot is out."""
        twist = self._back_up_path.step(points, pose, self._mission.radius_m)
        if twist is not None:
            self._detour.decision = Decision(
                Action.BACK if twist.linear_x else Action.BLOCKED, inf, pi, "wall", "out of a trap"
            )
            return twist
        self._stuck_monitor.out()
        self._detour.decision = None
        self.follower.rejoin(pose, self._last)
        if self._back_up_path.trap is not None:
            self._bar(self._back_up_path.trap, now)
        return wanted

    def _follow(self, points: list[Point], pose: Pose2D, twist: Twist, dt: float, now: float) -> Twist:
        sighting = None if self.predecessor is None else self.predecessor.at(now)
        slot = self.formation.slot_of(self._id)
        wanted = self.follower.step(sighting, slot, pose, twist, dt, on_trace=self.formation.trace)
        if sighting is None or sighting.age_s > FRESH_S:
            return wanted
        if self.formation.trace and self.follower.readout.error_m < ON_TRACE_M:
            return wanted
        slot_map = self.follower.readout.slot_map
        back = self._catch_up((slot_map.x, slot_map.y), points, pose, now)
        if back is not None:
            return back
        within_m = BESIDE_SLOT_SHARE * slot.separation_m
        beside = self._free_slot.steer((slot_map.x, slot_map.y), points, pose, sighting.twist.linear_x, within_m, now)
        if beside is not None:
            self._detour.decision = None
            return beside
        speed = abs(sighting.twist.linear_x) + CATCH_UP_PER_S * hypot(slot_map.x - pose.x, slot_map.y - pose.y)
        speed = min(self._mission.limits.v_max_mps, speed)
        # The target is the slot's future place: in the slot itself its direction is undefined.
        ahead_m = min(SLOT_AHEAD_S * sighting.twist.linear_x, SLOT_AHEAD_SHARE * slot.separation_m)
        target = in_base(pose, (slot_map.x + ahead_m * cos(slot_map.theta), slot_map.y + ahead_m * sin(slot_map.theta)))
        was_detour = self._detour.decision is not None
        if not was_detour:
            points = without(points, in_base(pose, (sighting.pose.x, sighting.pose.y)), self._mission.radius_m + 0.1)
        around = self._steer(points, target, wanted, speed, pose, now)
        if around is None:
            if was_detour:
                self.follower.rejoin(pose, self._last)
            return wanted
        return around
