"""Path follower of a leader: along way-points, point to point or straight to the goal, and to rest there.

Every robot knows the route and keeps its own progress on it, so that the next leader continues from where the team is.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from itertools import pairwise
from math import atan2, ceil, cos, hypot, inf, pi, sin, tan

from lfa.agents.config import CONTROL_PERIOD_S
from lfa.agents.formation.formation import COLUMN_BELOW_MPS, PLANNED_MARGIN, leader_speed_cap
from lfa.protocol.geometry import Point, Pose2D, Twist, in_base, wrap
from lfa.protocol.messages.team import Slot
from lfa.protocol.mission import Leading, Limits

CORNER_RADIUS_M = 2.5
SPACING_M = 0.1
LOOK_AHEAD_M = 0.6
PLANNED_LOOK_AHEAD_M = 0.35
PLANNED_CORNER_RADIUS_M = 0.8
"""Corner radius of a planned route: it is already smooth, and its clearance holds for the path itself."""
DETOUR_AHEAD_M = 2.0
WINDOW_M = 0.5
BRAKING_SHARE = 0.6
IN_PLACE_RAD = 1.0
IN_PLACE_RADPS = 0.4
SLOWEST_SHARE = 0.25
"""Minimum fraction of the cruise speed on a planned route's bends, so that the path is tracked and not cut."""
ARRIVED_MPS = 0.02
LATERAL_GAIN = 1.2


class Route:
    """Polyline in `map` with rounded corners, its arc length and curvature."""

    def __init__(self, points: Sequence[Point], corner_radius_m: float = CORNER_RADIUS_M) -> None:
        self.points = _resampled(_rounded(points, corner_radius_m), SPACING_M)
        self.at_m = [0.0]
        for a, b in pairwise(self.points):
            self.at_m.append(self.at_m[-1] + hypot(b[0] - a[0], b[1] - a[1]))
        self.length_m = self.at_m[-1]
        self._legs = [_leg(a, b) for a, b in pairwise(self.points)]
        self.curvature = _curvatures(self.points)

    def point(self, s: float) -> Point:
        """Return the point at arc length `s` [m], clamped to the ends."""
        i = self.segment(s)
        (ax, ay), (bx, by) = self.points[i], self.points[i + 1]
        share = (min(max(s, 0.0), self.length_m) - self.at_m[i]) / max(self.at_m[i + 1] - self.at_m[i], 1e-9)
        return ax + share * (bx - ax), ay + share * (by - ay)

    def nearest(self, x: float, y: float, low_m: float = 0.0, high_m: float = inf) -> float:
        """Return the arc length of the point nearest to (x, y) between `low_m` and `high_m`."""
        first, last = self.segment(low_m), self.segment(min(high_m, self.length_m))
        best, nearest, share_of_it = inf, -1, 0.0
        for i, (ax, ay, dx, dy, square) in enumerate(self._legs[first : last + 1], first):
            px, py = x - ax, y - ay
            share = (px * dx + py * dy) / square
            share = 0.0 if share < 0.0 else 1.0 if share > 1.0 else share
            apart = hypot(px - share * dx, py - share * dy)
            if apart < best:
                best, nearest, share_of_it = apart, i, share
        if nearest < 0:
            return low_m
        return self.at_m[nearest] + share_of_it * (self.at_m[nearest + 1] - self.at_m[nearest])

    def segment(self, s: float) -> int:
        """Return the index of the point at or before arc length `s` [m]."""
        return min(max(bisect_right(self.at_m, s) - 1, 0), len(self.points) - 2)


class PathFollower:
    """Progress of one robot along the route, and its twist when it leads."""

    def __init__(self, leading: Leading, limits: Limits, radius_m: float = 0.15) -> None:
        """Create a path follower; `radius_m` is the room that a robot needs beside known obstacles
        (`Leading.known_m`).
        """
        self._leading = leading
        self._radius_m = radius_m
        self._limits = limits
        self._route: Route | None = None
        self._planned = leading.motion == "explore"
        self._reactive = leading.motion == "reactive"
        self._from_m: float | None = None
        self._look_ahead_m = PLANNED_LOOK_AHEAD_M if self._planned else LOOK_AHEAD_M
        self._s = 0.0

    def track(self, pose: Pose2D) -> None:
        """Update the progress; called for leaders and followers."""
        if self._reactive:
            straight = hypot(self.goal[0] - pose.x, self.goal[1] - pose.y)
            self._from_m = straight if self._from_m is None else self._from_m
            self._s = max(self._s, self._from_m - straight)
        if self._route is None and (self._planned or self._reactive):
            return
        if self._route is None:
            self._route = self._first_route(pose)
            self._s = self._route.nearest(pose.x, pose.y)
        else:
            self._s = self._route.nearest(pose.x, pose.y, self._s - WINDOW_M, self._s + 2.0 * WINDOW_M)

    def begin(self, pose: Pose2D) -> None:
        """Start leading; point to point drives straight from the present pose."""
        self.track(pose)
        if self._leading.motion == "point_to_point":
            self._route = Route([(pose.x, pose.y), self.goal])
            self._s = 0.0

    def take(self, points: Sequence[Point], pose: Pose2D) -> None:
        """Replace the route by an own one (`explore`), starting at its nearest point."""
        self._route = Route(points, PLANNED_CORNER_RADIUS_M)
        self._s = self._route.nearest(pose.x, pose.y, 0.0, 2.0 * WINDOW_M)

    @property
    def goal(self) -> Point:
        return self._leading.route_m[-1]

    @property
    def route(self) -> Route | None:
        """Present route; None before the own pose is known, and for a motion without a route."""
        return self._route

    @property
    def progress_m(self) -> float:
        """Arc length [m] driven on the route, or distance gained to the goal; 0 before the own pose is known."""
        return self._s

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

    def remaining_m(self, pose: Pose2D) -> float:
        """Return the distance [m] to the goal: along the route, or straight at the route's end."""
        straight = hypot(self.goal[0] - pose.x, self.goal[1] - pose.y)
        return max(self._route.length_m - self._s, straight) if self._route is not None else straight

    def arrived(self, pose: Pose2D, twist: Twist) -> bool:
        """Return whether the robot is at rest within the goal's tolerance."""
        near = hypot(self.goal[0] - pose.x, self.goal[1] - pose.y) <= self._leading.goal_tolerance_m
        return near and abs(twist.linear_x) < ARRIVED_MPS

    def ahead(self, pose: Pose2D, by_m: float = DETOUR_AHEAD_M) -> Point:
        """Return the route's point `by_m` ahead, in `base_link`: a detour leads back to it."""
        if self._route is not None:
            return in_base(pose, self._route.point(self._s + by_m))
        x, y = in_base(pose, self.goal)
        share = min(1.0, by_m / max(hypot(x, y), 1e-9))
        return share * x, share * y

    def step(self, pose: Pose2D, twist: Twist, slots: Sequence[Slot], speed_max_mps: float) -> Twist:
        """Return the wanted twist at `pose`, at most `speed_max_mps`; `slots` are those of the robots behind."""
        self.track(pose)
        if self._route is None and not self._reactive:
            return Twist(0.0, 0.0)
        straight = hypot(self.goal[0] - pose.x, self.goal[1] - pose.y)
        if straight <= 0.3 * self._leading.goal_tolerance_m:
            return Twist(0.0, 0.0)
        left_m = straight if self._route is None else self._route.length_m - self._s
        near_end = left_m < self._look_ahead_m
        target = in_base(pose, self.goal) if near_end else self.ahead(pose, self._look_ahead_m)
        braking = (2.0 * BRAKING_SHARE * self._leading.acceleration_mps2 * straight) ** 0.5
        bearing = atan2(target[1], target[0])
        v = min(self._cruise(slots), braking, speed_max_mps)
        if self._planned:
            v *= max(SLOWEST_SHARE, 1.0 - abs(bearing) / IN_PLACE_RAD)
        # This limit is last: a share of it would be taken again in each following step.
        v = min(v, abs(twist.linear_x) + self._leading.acceleration_mps2 * CONTROL_PERIOD_S)
        if near_end and abs(bearing) > pi / 2 and straight < 2.0 * self._leading.goal_tolerance_m:
            return Twist(-min(v, 0.1), 0.0) if abs(bearing) > 0.8 * pi else self._turn(bearing)
        if abs(bearing) > IN_PLACE_RAD:
            return self._turn(bearing)
        reach = max(hypot(*target), 0.25)
        curvature = 2.0 * target[1] / (reach * reach)
        return Twist(v, v * curvature)

    def _turn(self, bearing: float) -> Twist:
        return Twist(0.0, IN_PLACE_RADPS if bearing > 0.0 else -IN_PLACE_RADPS)

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

    def _first_route(self, pose: Pose2D) -> Route:
        points = list(self._leading.route_m)
        if len(points) == 1 or self._leading.motion == "point_to_point":
            points = [(pose.x, pose.y), points[-1]]
        if hypot(points[0][0] - points[-1][0], points[0][1] - points[-1][1]) < 1e-6 and len(points) == 2:
            points[0] = (points[0][0] - 0.01, points[0][1])
        if self._leading.known_m:
            # Imported here: only runs with obstacles known from an earlier run need it.
            from lfa.agents.leading.known_obstacles import past_known

            if hypot(points[0][0] - pose.x, points[0][1] - pose.y) > CORNER_RADIUS_M:
                points = [(pose.x, pose.y), *points]
            points = past_known(points, self._leading.known_m, self._radius_m)
        return Route(points)


def _leg(a: Point, b: Point) -> tuple[float, float, float, float, float]:
    """Return a leg's start, its direction and length as (dx, dy), and its length squared."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    return *a, dx, dy, max(dx * dx + dy * dy, 1e-12)


def _rounded(points: Sequence[Point], radius_m: float) -> list[Point]:
    """Replace corners by arcs of `radius_m`, smaller where the legs are short."""
    rounded = [points[0]]
    for a, corner, b in zip(points, points[1:], points[2:], strict=False):
        leg_in, leg_out = hypot(corner[0] - a[0], corner[1] - a[1]), hypot(b[0] - corner[0], b[1] - corner[1])
        heading = atan2(corner[1] - a[1], corner[0] - a[0])
        turn = wrap(atan2(b[1] - corner[1], b[0] - corner[0]) - heading)
        cut = min(radius_m * tan(min(abs(turn), 3.0) / 2.0), 0.45 * leg_in, 0.45 * leg_out)
        if abs(turn) < 0.02 or cut < 1e-3:
            rounded.append(corner)
            continue
        r = cut / tan(min(abs(turn), 3.0) / 2.0)
        side = 1.0 if turn > 0.0 else -1.0
        start = (corner[0] - cut * cos(heading), corner[1] - cut * sin(heading))
        center = (start[0] - side * r * sin(heading), start[1] + side * r * cos(heading))
        steps = max(2, ceil(abs(turn) * r / SPACING_M))
        for n in range(steps + 1):
            angle = heading - side * pi / 2 + turn * n / steps
            rounded.append((center[0] + r * cos(angle), center[1] + r * sin(angle)))
    rounded.append(points[-1])
    return rounded


def _resampled(points: Sequence[Point], spacing_m: float) -> list[Point]:
    """Return the polyline with segments of at most `spacing_m` and without repeated points."""
    out = [points[0]]
    for a, b in pairwise(points):
        length = hypot(b[0] - a[0], b[1] - a[1])
        if length < 1e-9:
            continue
        steps = ceil(length / spacing_m)
        out += [(a[0] + (b[0] - a[0]) * n / steps, a[1] + (b[1] - a[1]) * n / steps) for n in range(1, steps + 1)]
    return out if len(out) > 1 else [points[0], (points[0][0] + 1e-3, points[0][1])]


def _curvatures(points: Sequence[Point]) -> list[float]:
    """Return the signed curvature [1/m] at each point, from the points 0.3 m before and after it, left > 0."""
    reach = max(1, round(0.3 / SPACING_M))
    out = [0.0] * len(points)
    for i in range(reach, len(points) - reach):
        a, b, c = points[i - reach], points[i], points[i + reach]
        turn = wrap(atan2(c[1] - b[1], c[0] - b[0]) - atan2(b[1] - a[1], b[0] - a[0]))
        length = 0.5 * (hypot(b[0] - a[0], b[1] - a[1]) + hypot(c[0] - b[0], c[1] - b[1]))
        out[i] = turn / max(length, 1e-6)
    return out
