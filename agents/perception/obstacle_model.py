"""Obstacle model of one robot: scan points, the obstacles that they belong to, and blocking floor.

The interface of perception for the navigator: free distance, moving obstacles, and the obstacle that blocks the way.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, hypot, inf, sin

from lfa.agents.perception.ground_map import GroundMap
from lfa.agents.perception.obstacle import BlockingObstacle
from lfa.agents.perception.obstacle_tracker import WALL_M, Feature, Tracker
from lfa.agents.perception.scan import SIGHT_M, Point, Surroundings
from lfa.agents.perception.seen_edges import SeenEdges
from lfa.agents.perception.shared_obstacles import SharedObstacles
from lfa.protocol.geometry import Pose2D, Twist, along_arc
from lfa.protocol.messages.robot import GroundProfile, LaserScan
from lfa.protocol.mission import Limits

LOOK_M = 2.0
TRAP_M = 0.8
"""Radius [m] of the place in which a leader got stuck."""
MATE_M = 0.6
"""Distance [m] to a team-mate's expected position below which an obstacle is that team-mate: table rows are half a
second old."""
MATES_M = SIGHT_M + 0.5 * WALL_M + MATE_M + 0.1
"""Distance [m] beyond which no team-mate matters to a scan: an obstacle's centre is at most half its width behind the
nearest of its points, and what is wider than `WALL_M` is a wall in any case."""
OWN_M = 0.15
"""Distance [m] to the surface of a moving obstacle below which a scan point belongs to it."""
BODY_M = 0.15
"""Distance [m] beyond the body of a team-mate up to which a point of the scan is that team-mate."""
NEAR_M = 0.3
"""Distance [m] to the end of the free way below which an obstacle is the one that blocks it."""
TURN_MPS = 0.05


class ObstacleModel:
    """Obstacle model of one robot. `ground` is the floor as far as sensed."""

    def __init__(self, radius_m: float, limits: Limits, shared: SharedObstacles, *, polygon: bool = False) -> None:
        """Create an empty model; a body that is a `polygon` has corners where its scanner may not look."""
        self._radius_m = radius_m
        self._shared = shared
        self._scan = Surroundings(remembers=polygon)
        self._edges = SeenEdges(radius_m)
        self._tracker = Tracker()
        self._jumps = 0
        """Number of jumps of the pose before the newest scan."""
        self.ground = GroundMap(limits)

    def see(self, scan: LaserScan, pose: Pose2D, mates: Sequence[Pose2D], now: float, jumps: int = 0) -> None:
        """Update with a scan made at `pose`, and assign its points to obstacles.

        `mates` are the team-mates within `MATES_M`, and may hold farther ones. `jumps` counts those of the pose: with
        one, walls lie elsewhere in `map` than in the scans before.
        """
        if jumps != self._jumps:
            self._jumps = jumps
            self._tracker.forget_surfaces()
            self._edges.forget()
            self._scan.jump(pose)
        places = [(mate.x, mate.y) for mate in mates]
        self._scan.scan(scan, pose, now, places, MATE_M)
        seen, eye = self._scan, (pose.x, pose.y)
        self._tracker.update(seen.points_map, eye, places, MATE_M, now, seen.reach_m, seen.step_rad)
        moving = [((feature.x, feature.y), feature.radius_m + OWN_M) for feature in self._tracker.moving(now)]
        bodies = [(place, self._radius_m + BODY_M) for place in places]
        self._edges.see(scan, seen.points_map, pose, moving + bodies, now)

    def update_ground(self, profile: GroundProfile, pose: Pose2D, now: float) -> None:
        """Update with a profile of the floor ahead, made at `pose`."""
        self.ground.profile(profile, pose, now)

    def avoid_trap(self, x: float, y: float, now: float) -> None:
        """Block a place in which a robot got stuck."""
        self.ground.bar_circle(x, y, TRAP_M, "wall", now)

    def enter_trap(self, x: float, y: float) -> None:
        """Take back that a place is blocked in which a robot got stuck."""
        self.ground.free_circle(x, y, TRAP_M)

    def points(self, pose: Pose2D, *, traps: bool = True) -> list[Point]:
        """Return the points that block the way near `pose`, in `base_link`; without `traps` not those around a place in
        which a robot got stuck: who has planned its way on a map needs no such warning, and a trap may lie in a gap.
        """
        floor = self.ground.points(pose, LOOK_M, walls=traps)
        seen = self._scan.points(pose, LOOK_M) + self._edges.points(pose)
        return seen + floor if floor else seen

    def moving(self, pose: Pose2D, now: float) -> list[Feature]:
        """Return the moving obstacles, as seen by this robot and as reported by others."""
        return self._shared.moving(self._tracker.moving(now), pose, now, self._tracker.shows, self._looks_through)

    def _looks_through(self, place: Point) -> bool:
        """Return whether the newest scan looks through `place` in `map`."""
        return self._scan.looks_at(place) and self._tracker.looks_through(place)

    def blocking(self, pose: Pose2D, wanted: Twist, free_m: float, now: float) -> BlockingObstacle:
        """Return the obstacle that ends the way along `wanted` after `free_m` [m]."""
        v = max(abs(wanted.linear_x), TURN_MPS)
        end = along_arc(pose, wanted, min(free_m, LOOK_M) / v)
        x, y = end.x + self._radius_m * cos(end.theta), end.y + self._radius_m * sin(end.theta)
        seen = self._tracker.nearest(x, y, now)
        floor = self.ground.nearest(x, y, NEAR_M if seen is None else min(NEAR_M, seen[1]))
        if floor is not None:
            return BlockingObstacle(*floor)
        if seen is None:
            return BlockingObstacle()
        return BlockingObstacle(seen[0].kind, 2.0 * seen[0].radius_m if seen[0].whole else inf)

    def nearest(self, pose: Pose2D, kind: str, now: float) -> Feature | None:
        """Return the nearest obstacle of class `kind` that this robot itself sees, for its report to the others."""
        of_kind = [feature for feature in self._tracker.features(now) if feature.kind == kind]
        return min(of_kind, key=lambda f: hypot(f.x - pose.x, f.y - pose.y) - f.radius_m, default=None)


def resting(points: list[Point], pose: Pose2D, moving: Sequence[Feature]) -> list[Point]:
    """Return `points` (in `base_link`) without those that belong to moving obstacles."""
    if not moving:
        return points
    c, s = cos(pose.theta), sin(pose.theta)

    things = [(feature.x, feature.y, feature.radius_m + OWN_M) for feature in moving]
    left: list[Point] = []
    for point in points:  # a loop, as this is done for each point in each control step
        x, y = pose.x + c * point[0] - s * point[1], pose.y + s * point[0] + c * point[1]
        for at_x, at_y, own_m in things:
            if hypot(x - at_x, y - at_y) < own_m:
                break
        else:
            left.append(point)
    return left
