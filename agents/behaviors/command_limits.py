"""Limits of a robot's command, each applied once, to whatever its behaviour wants."""

from __future__ import annotations

from collections.abc import Sequence

from msgspec.structs import replace

from lfa.agents.avoidance.moving_points import before
from lfa.agents.avoidance.safety import safe, sharing, sharing_reach_m
from lfa.agents.behaviors.team_mates import TeamMates
from lfa.agents.localization.estimator import Estimator
from lfa.agents.perception.footprint import PolygonBody
from lfa.agents.perception.obstacle_model import ObstacleModel
from lfa.agents.perception.obstacle_tracker import Feature
from lfa.agents.perception.scan import Point
from lfa.agents.perception.scan_age import ScanAge
from lfa.protocol.geometry import Pose2D, Twist, slowed
from lfa.protocol.messages.consensus import Role
from lfa.protocol.mission import Mission

BEFORE_S = 0.5
"""Time [s] ahead for which the robot brakes before what comes towards it."""
MATES_M = 1.5
"""Distance [m] up to which team-mates are looked at: twice a body's width, and the way of both in that time."""

USUAL_PERIOD_S, LAG_PERIODS = 0.02, 2.0
"""Control period [s] whose lag the braking's reserve covers, and number of periods beyond it in which two robots that
approach drive on: until the other one's pose is known, and until the own command acts."""


class CommandLimits:
    """Limits of one robot: by team-mates, by the age of scan and pose, by the drive, and by all obstacles last."""

    def __init__(
        self, mission: Mission, mates: TeamMates, scan_age: ScanAge, estimator: Estimator, obstacles: ObstacleModel
    ) -> None:
        self._mission = mission
        self.period_s = mission.control_period_s
        """Period [s] of the control steps, longer than the mission's while the machine keeps the robot late."""
        self._footprint = PolygonBody.of(mission)
        self._mates = mates
        self._scan_age = scan_age
        self._estimator = estimator
        self._obstacles = obstacles

    def slow(self, wanted: Twist, role: Role, pose: Pose2D, now: float, *, by_law: bool) -> Twist:
        """Return `wanted`, slowed towards team-mates that no controller keeps a distance to, and by old inputs.

        `by_law`: the robot moves by a follower's law, and not on a way of its own.
        """
        limits, radius_m = self._mission.limits, self._mission.radius_m
        # A controller may want any speed; what is beyond the drive's, `safe` takes away.
        fastest_mps = min(abs(wanted.linear_x), max(limits.v_max_mps, limits.v_reverse_max_mps))
        lag_s = LAG_PERIODS * max(0.0, self.period_s - USUAL_PERIOD_S)
        reach_m = sharing_reach_m(Twist(fastest_mps, 0.0), radius_m, limits, lag_s)
        strangers = self._mates.strangers(pose, reach_m, now, by_law=by_law)
        wanted = sharing(wanted, strangers, radius_m, limits, lag_s)
        # A leader drives at its cruise speed, but may flee from what moves faster than that.
        cruise_mps = max(self._mission.leading.cruise_mps, abs(wanted.linear_x))
        usual_mps = cruise_mps if role is Role.LEADER else limits.v_max_mps
        wanted = slowed(self._scan_age.limited(wanted, now), self._scan_age.speed_max_mps(usual_mps))
        return self._estimator.limited(wanted)

    def lost_input(self, now: float) -> str | None:
        """Return the input of the robot's own hardware that is too old to drive by; None when all is well."""
        missing = self._estimator.missing(now)
        if missing is not None:
            return missing
        if self._estimator.unfixed:
            return "localization"
        return "scan" if self._scan_age.lost(now) else None

    def brake(
        self,
        wanted: Twist,
        last: Twist,
        points: list[Point],
        moving: Sequence[Feature],
        pose: Pose2D,
        dt: float,
        now: float,
    ) -> Twist:
        """Return `wanted` within the drive's limits, and slow enough to stop before all that is seen or doubtful, and
        before where team-mates drive to: a scan shows where they were.
        """
        mates = self._mates.moving(pose, MATES_M, now) if wanted.linear_x else []
        bodies = [replace(mate, radius_m=self._mission.radius_m) for mate in mates]
        met = before([*moving, *bodies], pose, BEFORE_S, wanted.linear_x)
        braked_for = points + self._obstacles.ground.doubtful(pose) + met
        return safe(wanted, last, braked_for, self._mission.radius_m, self._mission.limits, dt, self._footprint)
