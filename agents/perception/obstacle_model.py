"""What is around one robot: the points that a scan shows, what they belong to, and the floor that bars the way.

Perception in one place: the driver asks how far a way is free, what moves, and what it is that bars the way.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, hypot, inf, sin

from lfa.agents.perception.ground_map import GroundMap
from lfa.agents.perception.obstacle import BlockingObstacle
from lfa.agents.perception.obstacle_tracker import Feature, Tracker
from lfa.agents.perception.scan import Point, Surroundings
from lfa.agents.perception.shared_obstacles import SharedObstacles
from lfa.protocol.geometry import Pose2D, Twist, along_arc
from lfa.protocol.messages.robot import GroundProfile, LaserScan
from lfa.protocol.mission import Limits

LOOK_M = 2.0
TRAP_M = 0.8
"""Radius of the place in which a leader got stuck."""
MATE_M = 0.6
"""A thing nearer than this to where a team-mate should be is that team-mate: the table's rows are half a second old."""
OWN_M = 0.15
"""A point nearer than this to the surface of what moves belongs to it."""
NEAR_M = 0.3
"""What bars the way is the thing nearer than this to where the way ends."""
TURN_MPS = 0.05


class ObstacleModel:
    """Of one robot. `ground` is the floor as far as felt."""

    def __init__(self, radius_m: float, limits: Limits, shared: SharedObstacles) -> None:
        self._radius_m = radius_m
        self._shared = shared
        self._scan = Surroundings()
        self._tracker = Tracker()
        self.ground = GroundMap(limits)

    def see(self, scan: LaserScan, pose: Pose2D, mates: Sequence[Pose2D], now: float, *, track: bool) -> None:
        """Take a scan made at `pose`; with `track`, tell what its points belong to."""
        self._scan.scan(scan, pose, now)
        if track:
            places = [(mate.x, mate.y) for mate in mates]
            self._tracker.update(self._scan.points_map, (pose.x, pose.y), places, MATE_M, now)

    def update_ground(self, profile: GroundProfile, pose: Pose2D, now: float) -> None:
        """Take a look at the floor ahead, made at `pose`."""
        self.ground.profile(profile, pose, now)

    def avoid_trap(self, x: float, y: float, now: float) -> None:
        """Keep out of a place in which a robot got stuck."""
        self.ground.bar_circle(x, y, TRAP_M, "wall", now)

    def points(self, pose: Pose2D) -> list[Point]:
        """What bars the way near `pose`, in `base_link`."""
        floor = self.ground.points(pose, LOOK_M)
        seen = self._scan.points(pose, LOOK_M)
        return seen + floor if floor else seen

    def moving(self, pose: Pose2D, now: float) -> list[Feature]:
        """What moves, as seen by this robot and as told by others."""
        return self._shared.moving(self._tracker.moving(now), pose, now, self._tracker.shows)

    def blocking(self, pose: Pose2D, wanted: Twist, free_m: float, now: float) -> BlockingObstacle:
        """What ends the way along `wanted` after `free_m`."""
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
        """The nearest thing of class `kind` that this robot itself sees: what it tells the others."""
        of_kind = [feature for feature in self._tracker.features(now) if feature.kind == kind]
        return min(of_kind, key=lambda f: hypot(f.x - pose.x, f.y - pose.y) - f.radius_m, default=None)


def resting(points: list[Point], pose: Pose2D, moving: Sequence[Feature]) -> list[Point]:
    """`points` (in `base_link`) less those that belong to what moves."""
    if not moving:
        return points
    c, s = cos(pose.theta), sin(pose.theta)

    def belongs(point: Point) -> bool:
        x, y = pose.x + c * point[0] - s * point[1], pose.y + s * point[0] + c * point[1]
        return any(hypot(x - f.x, y - f.y) < f.radius_m + OWN_M for f in moving)

    return [point for point in points if not belongs(point)]
