"""Motion of one agent: own pose, predecessor, obstacles, and the twist that follows from them.

One function decides (`drive`): lead, follow or stand; then avoid the obstacles of the scan; then apply the limits.
Terms and keys may not be used here.
"""

from __future__ import annotations

from msgspec.structs import replace

from lfa.agents.avoidance.decision import Decision
from lfa.agents.avoidance.detour import Detour
from lfa.agents.avoidance.ground_crossing import GroundCrossing
from lfa.agents.avoidance.moving_obstacle import Crossing
from lfa.agents.avoidance.moving_points import standing
from lfa.agents.avoidance.safety import safe
from lfa.agents.behaviors.back_out import BackOut
from lfa.agents.behaviors.command_limits import CommandLimits
from lfa.agents.behaviors.follow_slot import FollowSlot
from lfa.agents.behaviors.lead_route import LeadRoute
from lfa.agents.behaviors.own_behavior import BehaviorInput, OwnBehaviors
from lfa.agents.behaviors.team_mates import TeamMates
from lfa.agents.following.factory import follower_of, predecessor_of
from lfa.agents.following.predecessor import Predecessor
from lfa.agents.formation.formation import Formation
from lfa.agents.leading.hand_driving import HandDriving
from lfa.agents.leading.leader import LEADER_OMEGA_MAX_RADPS, Leadership
from lfa.agents.localization.estimator import Estimator
from lfa.agents.perception.obstacle_model import MATES_M, ObstacleModel
from lfa.agents.perception.obstacle_tracker import Feature
from lfa.agents.perception.own_readings import OwnReadings
from lfa.agents.perception.scan_age import LOST_S, ScanAge
from lfa.agents.recovery.stuck_detector import NEVER_PLACED_S, POSE_LOST_S, SCAN_LOST, WANTED_MPS, StuckMonitor
from lfa.agents.team_state import TeamState, sensors_s_max
from lfa.protocol.geometry import STILL, Pose2D, Twist
from lfa.protocol.messages.consensus import Role
from lfa.protocol.messages.robot import GroundProfile, LaserScan
from lfa.protocol.messages.team import ObstacleNote, RouteProgress
from lfa.protocol.mission import Mission

DT_MIN_S = 0.002


class Navigator:
    """Motion of one robot with one mission."""

    def __init__(self, robot_id: int, mission: Mission, team: TeamState) -> None:
        """Create a navigator. Raise `Refused` when the mission's gains, controller or behaviours are invalid."""
        self._id = robot_id
        self._mission = mission
        self._team = team
        self.estimator = Estimator(odometry_s_max=sensors_s_max(mission))
        self.formation = Formation.of(mission)
        self.follower = follower_of(mission)
        self.leading = Leadership(mission, self.formation, team)
        self._mates = TeamMates(robot_id, team)
        self._obstacles = ObstacleModel(
            mission.radius_m, mission.limits, team.obstacles, polygon=bool(mission.footprint_m)
        )
        self._ground_crossing = GroundCrossing(self._obstacles.ground, mission.limits, mission.radius_m)
        self.scan_age = ScanAge()
        self.own_readings = OwnReadings()
        self._detour = Detour(mission.radius_m, mission.limits, mission.control_period_s)
        self.hand_driving = HandDriving()
        self._begin_roles(mission)
        self._stuck_monitor = StuckMonitor(again=mission.leading.motion != "explore")
        self._back_out = BackOut(mission, self.follower, self._detour, self._obstacles, self._stuck_monitor)
        self._role = Role.WAITING
        self.last = STILL
        """Command of the newest control step."""
        self._driven_at: float | None = None
        self._placeless_since: float | None = None
        self.was_placed = False
        """True once the robot has had a pose."""

    def _begin_roles(self, mission: Mission) -> None:
        self.limits = CommandLimits(mission, self._mates, self.scan_age, self.estimator, self._obstacles)
        self._follow_slot = FollowSlot(
            mission, self.follower, self._detour, self._obstacles, self._mates, self.leading, self.own_readings
        )
        self._lead_route = LeadRoute(self.leading, self._detour, self._obstacles, mission, self.hand_driving)
        self._own = OwnBehaviors(mission)
        self._crossing = Crossing(mission.radius_m, mission.leading.cruise_mps, mission.limits)

    @property
    def predecessor(self) -> Predecessor | None:
        """Robot ahead in the chain, as far as it is heard; None for no predecessor."""
        return self._mates.predecessor

    @property
    def stuck(self) -> str | None:
        """Reason why this robot is stuck; None when it is not."""
        return self._stuck_monitor.reason

    def change(self, mission: Mission, route: int, now: float) -> None:
        """Go on with a mission that an operator has changed; `route`: version of the order that gave its route."""
        new_route = route != self._team.route
        self._mission = mission = replace(mission, control_hz=self._mission.control_hz)
        self.leading = Leadership(mission, self.formation, self._team)
        self._begin_roles(mission)
        if new_route:
            self._team.route, self._team.progress = route, None
        known = self.estimator.pose_at(now)
        if self._role is Role.LEADER and known is not None:
            # On a new route nothing has been driven yet, whatever the odometer says.
            self.leading.begin(known[0], 0.0 if new_route else self.estimator.odometer_m, now)
            self._stuck_monitor.begin(leading=True)

    def pace(self, control_hz: float) -> None:
        """Go on with `drive` called `control_hz` [Hz] times a second."""
        self._mission = replace(self._mission, control_hz=control_hz)
        self._detour.period_s = self.limits.period_s = self._mission.control_period_s
        self.leading.pace(self._mission)

    @property
    def pose_lost(self) -> bool:
        """True while the robot is stuck because it has no pose (S6)."""
        return self._stuck_monitor.pose_lost

    @property
    def failure(self) -> str | None:
        """Fault of the mission's controller, or of a behaviour of its own; None while they work."""
        return self.follower.failure or self._own.failure

    @property
    def decision(self) -> Decision | None:
        """Present avoidance decision; None on the wanted motion."""
        return self._crossing.decision or self._detour.decision or self._ground_crossing.decision

    def see(self, scan: LaserScan, now: float) -> None:
        """Update with a scan; one that only repeats the last, shows nothing or is old counts as none."""
        known, late_s = self.estimator.pose_at(now), self.estimator.late_s(scan.header, now)
        if known is not None and self.scan_age.update(scan, known[0], now, late_s):
            self._obstacles.see(scan, known[0], self._mates.nearby(known[0], MATES_M, now), now, self.estimator.jumps)
            if self.leading.explore is not None or self._follow_slot.catches_up:  # a map needs all of them
                mates = self._mates.places(now)
                self.leading.see(scan, known[0], known[1], mates)
                self._follow_slot.see(scan, known[0], known[1], mates)

    def update_ground(self, profile: GroundProfile, now: float) -> None:
        """Update the ground map with a profile of the floor ahead."""
        known = self.estimator.pose_at(now)
        if known is not None:
            self._obstacles.update_ground(profile, known[0], now)

    def avoid_trap(self, note: ObstacleNote) -> None:
        """Keep out of a place in which another robot got stuck."""
        self._back_out.bar((note.x, note.y))

    def back_out(self, pose: Pose2D) -> None:
        """Start backing out of the place in which the robot is stuck."""
        self._back_out.begin(pose)

    def nearest(self, pose: Pose2D, kind: str, now: float) -> Feature | None:
        """Return the nearest obstacle of class `kind` that this robot itself sees, for its report to the others."""
        return self._obstacles.nearest(pose, kind, now)

    def follow_robot(self, robot: int | None, followers: int) -> None:
        """Set the robot whose successor this robot is from now on; None for no predecessor."""
        before = self.predecessor
        if robot != (None if before is None else before.robot):
            self._mates.predecessor = None if robot is None else predecessor_of(self._mission, robot, followers, before)

    def hold(self, now: float) -> Twist:
        """Return the command of a control step without a pose: brake along the path."""
        if self._placeless_since is None:
            self._placeless_since = now
        missing = self.estimator.missing(now)
        patience_s = POSE_LOST_S if self.was_placed else NEVER_PLACED_S
        if missing is not None and now - self._placeless_since >= patience_s:
            self._stuck_monitor.lose_pose(missing)
        self._driven_at, self._detour.decision, self._crossing.decision = now, None, None
        period_s, limits = self._mission.control_period_s, self._mission.limits
        self.last = safe(STILL, self.last, (), self._mission.radius_m, limits, period_s)
        self.follower.overridden(self.last)
        return self.last

    def drive(self, role: Role, chain: tuple[int, ...], pose: Pose2D, twist: Twist, now: float) -> Twist:
        """Return the command for the next control period."""
        period_s = self._mission.control_period_s
        dt = min(max(period_s if self._driven_at is None else now - self._driven_at, DT_MIN_S), 2.0 * period_s)
        self._driven_at = now
        self._stuck_monitor.find_pose()
        if self._placeless_since is not None and self.was_placed:
            self.follower.rejoin(pose, twist)
        self._placeless_since, self.was_placed = None, True
        if role != self._role:
            self._change(role, pose, twist, now)
        self.leading.work(role is Role.LEADER, pose, self._mates.places, now)
        points = self._obstacles.points(pose, traps=not self._follow_slot.catches_up)
        moving = self._obstacles.moving(pose, now)
        still = standing(points, moving, pose, self._mission.radius_m, patient=self._crossing.patient)
        if role is Role.LEADER:
            wanted = self._lead_route.step(chain, still, pose, self.last, self.estimator.odometer_m, now)
        elif role is Role.FOLLOWER:
            wanted = self._follow_slot.step(still, pose, twist, self.last, dt, now, stuck=self.stuck is not None)
            if self._back_out.under_way:
                wanted = self._back_out.step(points, pose, wanted, self.last, now)
        else:
            wanted = meant = STILL
        if role is not Role.WAITING:
            wanted = self._own.step(BehaviorInput(now, role, pose, self.last, wanted, still, moving))
            wanted = self._crossing.give_way(moving, pose, wanted, now, points, self._mates.moving, self.last)
            wanted = meant = self._ground_crossing.cross(wanted, now)
            by_law = not (self._follow_slot.catches_up or self._back_out.under_way)
            wanted = self.limits.slow(wanted, role, pose, now, by_law=by_law)
        self._back_out.keep(pose, now)
        self._watch(role, pose, meant, wanted, now)
        self.last = self.limits.brake(wanted, self.last, points, moving, pose, dt, now)
        self.follower.overridden(self.last)
        if role is Role.LEADER:
            progress = self.leading.lead.progress(pose, self.last)
            self._team.progress = RouteProgress(progress.waypoint, progress.to_m, self._team.route)
        return self.last

    def narrow_ahead(self, pose: Pose2D) -> str | None:
        """Return the reason why only a column passes what is ahead of this leader; None when more do."""
        return self._lead_route.narrow_ahead(pose)

    def arrived(self, pose: Pose2D, twist: Twist) -> bool:
        return self._role is Role.LEADER and self.leading.lead.arrived(pose, twist)

    def _change(self, role: Role, pose: Pose2D, twist: Twist, now: float) -> None:
        self._role = role
        self._detour.decision = self._crossing.decision = None
        self._follow_slot.end()
        self._lead_route.by_hand = False
        self._stuck_monitor.begin(leading=role is Role.LEADER)
        omega_max = self._mission.limits.omega_max_radps
        self._detour.omega_max_radps = min(LEADER_OMEGA_MAX_RADPS, omega_max) if role is Role.LEADER else omega_max
        if role is Role.LEADER:
            self.leading.begin(pose, self.estimator.odometer_m, now)
        elif role is Role.FOLLOWER:
            self.follower.rejoin(pose, twist)

    def _watch(self, role: Role, pose: Pose2D, meant: Twist, wanted: Twist, now: float) -> None:
        """Update the stuck monitor. `meant` is `wanted` without limits; who waits or has arrived cannot be stuck."""
        leader, arrived = role is Role.LEADER, self.arrived(pose, self.last)
        if role is Role.WAITING or (leader and self.leading.waiting) or self._lead_route.by_hand or arrived:
            self._stuck_monitor.rest(pose, now)
            return
        action, moving = (None, False) if (said := self.decision) is None else (said.action, said.kind == "moving")
        held = role is Role.FOLLOWER and abs(meant.linear_x) >= WANTED_MPS > abs(wanted.linear_x)
        leads, plans = held or (leader and self.leading.under_way), leader and self.leading.plans
        lost = SCAN_LOST if self.scan_age.age_s(now) > LOST_S else None
        again, at = not (self.leading.rounding or self._follow_slot.catches_up), self.estimator.hung_at
        self._stuck_monitor.watch(
            pose, wanted, action, lost, now, leads=leads, again=again, moving=moving, plans=plans, hung_at=at
        )
