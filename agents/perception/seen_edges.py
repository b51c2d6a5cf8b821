"""Edges beside the robot that its newest scan does not show: a thin wall seen end-on lies between two beams.

In a doorway the ends of the walls are abeam, and what is thinner than the room between two beams is met by none of
them; on a wall seen along itself the points lie so far apart that its end is missing. What the scans before have shown
is still there.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import atan2, cos, hypot, sin

from msgspec import Struct

from lfa.agents.perception.scan import Point, is_covered
from lfa.protocol.geometry import Pose2D, wrap
from lfa.protocol.messages.robot import LaserScan

NEAR_M = 0.3
"""Distance [m] to the body up to which a point is kept."""
KEPT_S = 2.0
"""Time [s] for which a point is kept that no scan shows any more: as long as a robot takes that creeps past it."""
CELL_M = 0.015
"""Size [m] of the cells of which each keeps its newest point: noise does not add up to the nearest of many."""
BEHIND_M = 0.05
"""Distance [m] behind a point up to which both beams beside it may end for the newest scan to show what is there."""
SAME_M, SAME_RAD, SAME_S = 0.01, 0.01, 0.25
"""Motion [m, rad] below which two scans look the same way: what only the earlier one has shown has gone, once this time
[s] has passed. Between two scans a robot that creeps, or one whose scanner is fast, moves no farther either.
"""


class SeenEdge(Struct, frozen=True, gc=False):
    """Point in `map` [m], with the time [s] and the robot's pose of the last scan that showed it."""

    point: Point
    seen_at: float
    seen_from: Pose2D


class SeenEdges:
    """Points close to one robot that scans have shown, and of which the newest does not say that they are gone."""

    def __init__(self, radius_m: float) -> None:
        """Create an empty memory of a body of `radius_m`."""
        self._within_m = radius_m + NEAR_M
        self._edges: dict[tuple[int, int], SeenEdge] = {}
        self._last: tuple[Sequence[Point], float, Pose2D] | None = None
        """Points in `map` of the newest scan, its time [s], and the pose that it was made at."""

    def forget(self) -> None:
        """Forget all: `map` has moved."""
        self._edges, self._last = {}, None

    def see(
        self, scan: LaserScan, points: Sequence[Point], pose: Pose2D, others: Iterable[tuple[Point, float]], now: float
    ) -> None:
        """Update with a scan made at `pose`, of which `points` are in `map`.

        `others` are circles (centre in `map` and radius [m]) of what moves: of this nothing is kept.
        """
        known = self._edges
        if self._last is not None:
            before, at, seen_from = self._last
            for point in before:
                if self._is_near(point, pose):
                    known[round(point[0] / CELL_M), round(point[1] / CELL_M)] = SeenEdge(point, at, seen_from)
        circles = list(others)
        self._edges = {
            cell: edge for cell, edge in known.items() if self._stays(edge, scan, pose, now) and not _in(circles, edge)
        }
        self._last = points, now, pose

    def points(self, pose: Pose2D) -> list[Point]:
        """Return the points in `base_link`."""
        if not self._edges:
            return []
        x, y, c, s = pose.x, pose.y, cos(pose.theta), sin(pose.theta)
        away = [(edge.point[0] - x, edge.point[1] - y) for edge in self._edges.values()]
        return [(c * dx + s * dy, c * dy - s * dx) for dx, dy in away]

    def _is_near(self, point: Point, pose: Pose2D) -> bool:
        dx, dy = point[0] - pose.x, point[1] - pose.y
        return dx * dx + dy * dy < self._within_m * self._within_m

    def _stays(self, edge: SeenEdge, scan: LaserScan, pose: Pose2D, now: float) -> bool:
        """Return whether an edge may still be there, and the scan does not show what is in its place."""
        if now - edge.seen_at > KEPT_S or not self._is_near(edge.point, pose):
            return False
        dx, dy, before = edge.point[0] - pose.x, edge.point[1] - pose.y, edge.seen_from
        moved_m, turned_rad = hypot(before.x - pose.x, before.y - pose.y), abs(wrap(before.theta - pose.theta))
        if moved_m < SAME_M and turned_rad < SAME_RAD and now - edge.seen_at >= SAME_S:
            return False
        return not is_covered(scan, atan2(dy, dx) - pose.theta, hypot(dx, dy) + BEHIND_M)


def _in(circles: Sequence[tuple[Point, float]], edge: SeenEdge) -> bool:
    x, y = edge.point
    return any(hypot(x - at_x, y - at_y) < radius_m for (at_x, at_y), radius_m in circles)
