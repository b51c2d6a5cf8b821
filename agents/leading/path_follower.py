"""Path follower of a leader: along way-points, point to point or straight to the goal, and to rest there."""

from __future__ import annotations

from collections.abc import Sequence
from math import asin, atan2, hypot, inf, pi

from lfa.agents.avoidance.safety import turn_on_spot
from lfa.agents.config import CONTROL_PERIOD_S
from lfa.agents.formation.formation import COLUMN_BELOW_MPS, PLANNED_MARGIN, leader_speed_cap
from lfa.agents.leading.route_tracker import RouteTracker
from lfa.protocol.geometry import Point, Pose2D, Twist, in_base
from lfa.protocol.messages.team import Slot
from lfa.protocol.mission import Leading, Limits

LOOK_AHEAD_M = 0.6
PLANNED_LOOK_AHEAD_M = 0.35
DETOUR_AHEAD_M = 2.0
BRAKING_SHARE = 0.6
IN_PLACE_RAD = 1.0
TEAM_RADPS = 0.2
"""Turn rate [rad/s] on the spot with slots that swing around the robot; else the drive's, from which it can stop."""
SLOWEST_SHARE = 0.25
"""Minimum fraction of the cruise speed on a planned route's bends, so that the path is tracked and not cut."""
CORNER_MPS = 0.1
"""Minimum speed [m/s] up to a corner in which the robot turns."""


class PathFollower(RouteTracker):
    """Twist of one robot along its route when it leads."""

    def __init__(
        self,
        leading: Leading,
        limits: Limits,
        radius_m: float = 0.15,
        period_s: float = CONTROL_PERIOD_S,
        *,
        slots_swing: bool = True,
    ) -> None:
        """Create a path follower whose `step` is called each `period_s`; other arguments as of `RouteTracker`.

        Without `slots_swing` the slots stay where they are while the robot turns on the spot.
        """
        super().__init__(leading, radius_m)
        self.slots_swing = slots_swing
        self._limits = limits
        self.period_s = period_s
        self._straight_mps, self._ramp_mps = 0.0, 0.0
        """Speeds [m/s] that the last step allowed straight ahead, and by the acceleration."""
        self._look_ahead_m = PLANNED_LOOK_AHEAD_M if self._planned else LOOK_AHEAD_M

    def narrow_bend_m(self, slots: Sequence[Slot], within_m: float) -> float | None:
        """Return the distance [m] to the next bend in which `slots` would slow the leader below `COLUMN_BELOW_MPS`, or
        None.
        """
        if self._route is None:
            return None
        first, last = self._route.segment(self._s), self._route.segment(self._s + within_m)
        for i in range(first, last + 1):
            curvature = self._route.curvature[i]
            if curvature and leader_speed_cap(slots, curvature, self._limits, PLANNED_MARGIN) < COLUMN_BELOW_MPS:
                return self._route.at_m[i] - self._s
        return None

    def ahead(self, pose: Pose2D, by_m: float = DETOUR_AHEAD_M) -> Point:
        """Return the route's point `by_m` ahead, in `base_link`, but not beyond a way-point to be driven up to; a
        detour leads back to it.
        """
        if self._route is not None:
            at_m = self._s + by_m
            return in_base(pose, self._route.point(at_m) if at_m < self._stop_m else self._stop_point)
        x, y = in_base(pose, self.waypoint)
        share = min(1.0, by_m / max(hypot(x, y), 1e-9))
        return share * x, share * y

    def point(self, by_m: float) -> Point:
        """Return the point `by_m` ahead on the route in `map`; the next way-point without a route."""
        return self.waypoint if self._route is None else self._route.point(self._s + by_m)

    def step(self, pose: Pose2D, twist: Twist, slots: Sequence[Slot], speed_max_mps: float) -> Twist:
        """Return the wanted twist at `pose`, at most `speed_max_mps`; `slots` are those of the robots behind."""
        self.track(pose)
        if self._route is None and not self._reactive:
            return Twist(0.0, 0.0)
        stop_x, stop_y = self._stop_point
        straight = hypot(stop_x - pose.x, stop_y - pose.y)
        left_m = straight if self._route is None else self._stop_m - self._s
        near_end = left_m < self._look_ahead_m  # near the place is not enough: a route may pass it on the way
        ends = self._stop == self._last
        if ends and near_end and straight <= 0.3 * self._leading.goal_tolerance_m:
            return Twist(0.0, 0.0)
        target = in_base(pose, (stop_x, stop_y)) if near_end else self.ahead(pose, self._look_ahead_m)
        bearing = atan2(target[1], target[0])
        v = min(
            self._cruise(slots), self._braking(straight if near_end else max(straight, left_m), ends), speed_max_mps
        )
        # The acceleration's limit is last: a share of it would be taken again in each following step.
        self._straight_mps = v
        self._ramp_mps = abs(twist.linear_x) + self._leading.acceleration_mps2 * self.period_s
        v = min(_share(bearing) * v if self._planned else v, self._ramp_mps)
        if ends and near_end and abs(bearing) > pi / 2 and straight < 2.0 * self._leading.goal_tolerance_m:
            return Twist(-min(v, 0.1), 0.0) if abs(bearing) > 0.8 * pi else self._turn(bearing, slots)
        if abs(bearing) > IN_PLACE_RAD:
            return self._turn(bearing, slots)
        reach = max(hypot(*target), 0.25)
        curvature = 2.0 * target[1] / (reach * reach)
        return Twist(v, v * curvature)

    def bend_mps(self, curvature: float) -> float:
        """Return the speed [m/s] that the last step allowed on an arc of `curvature` [1/m] beside a planned route."""
        bearing = asin(min(1.0, 0.5 * self._look_ahead_m * abs(curvature)))
        return min(_share(bearing) * self._straight_mps, self._ramp_mps)

    def _braking(self, straight: float, ends: bool) -> float:
        """Return the speed [m/s] from which the robot can stop at the next way-point that it drives up to."""
        v = float((2.0 * BRAKING_SHARE * self._leading.acceleration_mps2 * straight) ** 0.5)
        return v if ends else max(v, CORNER_MPS)

    def _turn(self, bearing: float, slots: Sequence[Slot]) -> Twist:
        swing = slots and self.slots_swing
        return turn_on_spot(bearing, TEAM_RADPS if swing else inf, self._limits)

    def _cruise(self, slots: Sequence[Slot]) -> float:
        """Return the maximum speed [m/s] from which the robot can brake to the outermost robot's speed limit of each
        bend ahead.

        Computed backwards over the braking distance from cruise speed: bends further ahead do not matter, and a new
        leader's first command does not wait for the whole route.
        """
        route, cruise = self._route, self._leading.cruise_mps
        if route is None:
            return cruise
        braking = 2.0 * BRAKING_SHARE * self._leading.acceleration_mps2
        first, last = route.segment(self._s), route.segment(self._s + cruise * cruise / braking)
        speed = cruise
        for i in range(last, first - 1, -1):
            brake = (speed * speed + braking * (route.at_m[i + 1] - route.at_m[i])) ** 0.5
            speed = min(cruise, leader_speed_cap(slots, route.curvature[i], self._limits, PLANNED_MARGIN), brake)
        return speed


def _share(bearing: float) -> float:
    """Return the share of the speed that a planned route allows towards `bearing` [rad]."""
    return max(SLOWEST_SHARE, 1.0 - abs(bearing) / IN_PLACE_RAD)
