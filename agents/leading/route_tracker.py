"""Progress along the mission's way-points.

A route has been driven when all way-points have been passed in their order: a place that the route passes twice is
passed twice. The team's progress is the leader's; every robot hears it, and the next leader goes on from there.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from itertools import pairwise
from math import hypot, inf

from lfa.agents.leading.route import CORNER_RADIUS_M, Route
from lfa.protocol.geometry import Point, Pose2D, Twist
from lfa.protocol.messages.team import RouteProgress
from lfa.protocol.mission import Leading

PLANNED_CORNER_RADIUS_M = 0.8
"""Corner radius of a planned route: it is already smooth, and its clearance holds for the path itself."""
ROUNDED_SHARE = 0.5
"""Share of the way-point tolerance that a rounded corner uses; the rest is for the tracking."""
REACHED_SHARE = 0.7
"""Share of its tolerance within which a way-point counts as reached: the pose is uncertain."""
WINDOW_M = 0.5
START_M = 0.5
"""Distance [m] to the first way-point within which a robot begins the route there, and does not drive to it first."""
BEHIND_M = 10.0
"""Distance [m] along the route behind the former leader's place within which a new leader joins the route."""
WAY_ROUND = 1.5
"""Length of the way along the route, as a multiple of the straight one, above which a new leader goes straight to the
former leader's place: the robots behind did not drive up to the end of a turn-back, nor need they."""
JOIN_M = 1.0
"""Distance [m] to the route within which a robot that knows of no progress may join it on its way."""
ARRIVED_MPS = 0.02


class RouteTracker:
    """Progress of one robot along the mission's way-points."""

    def __init__(self, leading: Leading, radius_m: float = 0.15) -> None:
        """Create a tracker; `radius_m` is the room that a robot needs beside known obstacles (`Leading.known_m`)."""
        self._leading = leading
        self._radius_m = radius_m
        self._route: Route | None = None
        self._marks: tuple[float, ...] = ()
        """Arc length [m] of each way-point on the route; empty for a motion without a fixed route."""
        self._stops: tuple[int, ...] = ()
        """Way-points that the robot drives up to: sharp corners, and all way-points point to point."""
        self._planned = leading.motion == "explore"
        self._reactive = leading.motion == "reactive"
        self._last = len(leading.route_m) - 1
        self._next = 0
        """Index of the next way-point."""
        self._nearest_m = inf
        """Least distance [m] to the next way-point so far."""
        self._added = 0
        """Number of points that the route has before the first of its way-points."""
        self._from_m: float | None = None
        self.place: Point | None = None
        """Place that replaces the next way-point, where something stands on it."""
        self._s = 0.0
        self._reached_m = 0.0
        """Arc length [m] that the former leader had reached."""
        self.passed: list[tuple[int, float]] = []
        """Way-points passed since the list was last emptied, with the least distance [m] to each."""
        fixed = leading.motion in ("path_following", "trajectory") and self._last > 0
        self._whole = self._laid(list(leading.route_m)) if fixed else None
        """Route through all way-points, laid before it is needed: a new leader must not lose milliseconds with it."""

    def begin(self, pose: Pose2D, team: RouteProgress | None = None, driven_m: float = 0.0) -> None:
        """Start leading at `pose`, from the progress of the `team`.

        A robot that knows of none begins the route. It joins it on its way where it stands on it, if its odometer says
        that it has driven so far (`driven_m`).
        """
        if team is not None:
            self._next, self._nearest_m, self.place = min(team.waypoint, self._last), inf, None
        if not (self._planned or self._reactive):
            self._lay(pose)
            if team is not None:
                self._continue(pose, team)
            elif self._added == 0:
                self._join(pose, driven_m)
        self.track(pose)

    def track(self, pose: Pose2D) -> None:
        """Update the progress of the leader at `pose`: a way-point to drive up to is passed when it has been reached,
        another one when the route has been driven beyond it.
        """
        if self._route is not None:
            low_m, high_m = max(self._left_stop_m, self._s - WINDOW_M), min(self._s + 2.0 * WINDOW_M, self._stop_m)
            self._s = self._route.nearest(pose.x, pose.y, low_m, high_m)
        elif self._reactive:
            left_m = self._left_m(pose)
            self._from_m = left_m if self._from_m is None else self._from_m
            self._s = max(self._s, self._from_m - left_m)
        while True:
            near_m = _apart(self.waypoint, pose)
            self._nearest_m = min(self._nearest_m, near_m)
            if self._next == self._last or not self._is_passed(near_m):
                return
            self._pass()

    def progress(self, pose: Pose2D, twist: Twist) -> RouteProgress:
        """Return the progress of the leader at `pose`: the next way-point, and the distance to it."""
        if self.arrived(pose, twist):
            return RouteProgress(self._last + 1, 0.0)
        if self._marks:
            return RouteProgress(self._next, max(0.0, self._marks[self._next] - self._s))
        return RouteProgress(self._next, _apart(self.waypoint, pose))

    def end_at(self, place: Point) -> None:
        """Drive to `place` instead of the next way-point, on which something stands."""
        self.place = place

    def skip(self) -> None:
        """Pass over the next way-point, which cannot be reached; never the last."""
        if self._next < self._last:
            self._pass()

    def take(self, points: Sequence[Point], pose: Pose2D) -> None:
        """Replace the route by an own one (`explore`), starting at its nearest point."""
        self._route = Route(points, PLANNED_CORNER_RADIUS_M)
        self._s = self._route.nearest(pose.x, pose.y, 0.0, 2.0 * WINDOW_M)

    def resume(self, at_m: float, pose: Pose2D) -> None:
        """Go on at the point of the route nearest to `pose` around arc length `at_m`, after a way round a trap; the
        way-points before it are passed over.
        """
        if self._route is not None:
            self._s = self._route.nearest(pose.x, pose.y, max(0.0, at_m - WINDOW_M), at_m + WINDOW_M)
            while self._marks and self._next < self._last and self._s > self._marks[self._next]:
                self._pass()

    @property
    def waypoint(self) -> Point:
        """Way-point that comes next, or the free place beside it."""
        return self.place or self._leading.route_m[self._next]

    @property
    def waypoint_number(self) -> int:
        """Index of the next way-point in the mission's route."""
        return self._next

    @property
    def drives_up(self) -> bool:
        """True where the robot drives up to the next way-point itself, and does not round it."""
        return not self._marks or self.is_last or self._next in self._stops

    @property
    def is_last(self) -> bool:
        """True on the way to the last way-point, the goal."""
        return self._next == self._last

    @property
    def route(self) -> Route | None:
        """Present route; None before the robot leads, and for a motion without a route."""
        return self._route

    @property
    def waypoints_m(self) -> tuple[float, ...]:
        """Arc length [m] of each way-point on the route; empty without a fixed route."""
        return self._marks

    @property
    def place_m(self) -> float:
        """Arc length [m] of the present place on the route."""
        return self._s

    @property
    def progress_m(self) -> float:
        """Distance [m] driven along the mission's route from its first way-point, or gained towards the goal; a route
        of one point begins where the robot began.
        """
        return max(0.0, self._s - self._marks[0]) if self._last > 0 and self._marks else self._s

    def off_m(self, pose: Pose2D) -> float:
        """Return the distance [m] to the mission's route; 0 for a motion without one."""
        return _apart(self._route.point(self._s), pose) if self._route is not None and self._marks else 0.0

    @property
    def reached_m(self) -> float:
        """Distance [m] along the mission's route that the team has reached under any leader, as of `progress_m`."""
        first_m = self._marks[0] if self._last > 0 and self._marks else 0.0
        return max(self.progress_m, self._reached_m - first_m)

    def remaining_m(self, pose: Pose2D) -> float:
        """Return the distance [m] to the goal: along the route, or straight at the route's end."""
        straight = self._left_m(pose)
        return max(self._route.length_m - self._s, straight) if self._route is not None and self.is_last else straight

    def arrived(self, pose: Pose2D, twist: Twist) -> bool:
        """Return whether the robot has passed all way-points, and is at rest at the last one within its tolerance."""
        near = _apart(self.waypoint, pose) <= self._leading.goal_tolerance_m
        return self.is_last and near and abs(twist.linear_x) < ARRIVED_MPS

    def _is_passed(self, near_m: float) -> bool:
        if not self._marks or self._next in self._stops:
            return near_m <= REACHED_SHARE * self._leading.waypoint_tolerance_m
        return self._s > self._marks[self._next]

    def _pass(self) -> None:
        if self._marks:
            self._s = max(self._s, self._marks[self._next])
        elif self._planned:
            self._route = None
        self.passed.append((self._next, self._nearest_m))
        self._next, self._nearest_m, self.place = self._next + 1, inf, None

    def _left_m(self, pose: Pose2D) -> float:
        """Return the straight distance [m] to the goal by way of the way-points that are left."""
        points = self._leading.route_m[self._next :]
        return _apart(self.waypoint, pose) + sum(hypot(c - a, d - b) for (a, b), (c, d) in pairwise(points))

    def _lay(self, pose: Pose2D) -> None:
        """Lay the route through the way-points. At its beginning, and point to point, it leads there from `pose`."""
        direct = self._leading.motion == "point_to_point"
        first = self._next if direct else 0
        points = list(self._leading.route_m[first:])
        self._added = int(direct or self._last == 0 or (self._next == 0 and _apart(points[0], pose) > START_M))
        if self._added:
            same = _apart(points[0], pose) < 1e-6
            points.insert(0, (pose.x - 0.01, pose.y) if same else (pose.x, pose.y))
        if self._whole is not None and not self._added:
            self._route, passes_m = self._whole
        else:
            self._route, passes_m = self._laid(points)
        route = self._route
        self._marks = (*[0.0] * first, *passes_m[self._added :])
        self._stops = tuple(
            n
            for n in range(first, self._last)
            if direct or any(abs(self._marks[n] - at_m) < 1e-6 for at_m in route.sharp_m)
        )
        self._s = 0.0

    def _laid(self, points: list[Point]) -> tuple[Route, tuple[float, ...]]:
        """Return the route through `points`, and the arc length [m] at which it passes each."""
        route = self._route_through(points)
        return route, tuple(route.passes(points))

    def _route_through(self, points: list[Point]) -> Route:
        leading = self._leading
        if leading.known_m:
            # Imported here: only runs with obstacles known from an earlier run need it.
            from lfa.agents.leading.known_obstacles import past_known

            return Route(past_known(points, leading.known_m, self._radius_m))
        if leading.corner_radius_m is not None:
            return Route(points, leading.corner_radius_m)
        return Route(points, CORNER_RADIUS_M, ROUNDED_SHARE * leading.waypoint_tolerance_m)

    def _continue(self, pose: Pose2D, team: RouteProgress) -> None:
        """Join the route behind the former leader's place, but after the last way-point to be driven up to."""
        assert self._route is not None
        there_m = max(0.0, self._marks[self._next] - max(0.0, team.to_m))
        self._reached_m = there_m
        low_m = max(self._left_stop_m, there_m - BEHIND_M)
        here_m = self._route.nearest(pose.x, pose.y, min(low_m, there_m), there_m)
        along_m = _apart(self._route.point(here_m), pose) + there_m - here_m
        round_about = along_m > WAY_ROUND * _apart(self._route.point(there_m), pose)
        self._s = there_m if round_about else here_m
        self._next = min(bisect_right(self._marks, self._s), self._next)

    def _join(self, pose: Pose2D, driven_m: float) -> None:
        assert self._route is not None
        high_m = min(driven_m, self._route.length_m - JOIN_M)
        self._s = self._route.joined_m(pose.x, pose.y, pose.theta, JOIN_M, high_m)
        self._next = min(bisect_right(self._marks, self._s), self._last)

    @property
    def _stop(self) -> int:
        """Next way-point to drive up to."""
        return next((n for n in self._stops if n >= self._next), self._last) if self._marks else self._next

    @property
    def _left_stop_m(self) -> float:
        """Arc length [m] of the last way-point that was driven up to: the way back from it passes the same places."""
        return max((self._marks[n] for n in self._stops if n < self._next), default=0.0)

    @property
    def _stop_m(self) -> float:
        """Arc length [m] of the next way-point to drive up to, or of the route's end."""
        if self._marks and self._stop < self._last:
            return self._marks[self._stop]
        return self._route.length_m if self._route is not None else 0.0

    @property
    def _stop_point(self) -> Point:
        return self.waypoint if self._stop == self._next else self._leading.route_m[self._stop]


def _apart(point: Point, pose: Pose2D) -> float:
    return hypot(point[0] - pose.x, point[1] - pose.y)
