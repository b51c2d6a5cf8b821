"""Exploration of unknown ground: every robot maps all the time, so that a new leader has a map; the leader also
plans.
"""

from __future__ import annotations

from collections.abc import Sequence

from lfa.agents.exploration.map_tiles import Shown, Tiles
from lfa.agents.exploration.occupancy_grid import Mapping, Point, bounds
from lfa.agents.exploration.path_planner import Planner
from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.messages.robot import LaserScan
from lfa.protocol.mission import Mission

MARGIN_M = 15.0
"""Margin [m] around start and goal: ground farther out is not mapped, and no route leads through it."""
MAP_CELLS = 400
PLAN_CELLS, STANDING_PLAN_CELLS = 160, 480
"""Budgets [cells] of one control step; planning has more while the robot stands for want of a route, and so computes no
motion.
"""
TURNING_RADPS = 1.0
"""Turn rate [rad/s] above which a scan is not mapped: its beams do not share one pose."""
GIVE_UP_SEARCHES = 3
"""Number of successive searches, each on a newer map, without a way after which a goal counts as unreachable."""


class Explore:
    """Map and planner of one robot with one goal. `route` is in `map`; empty while there is none."""

    def __init__(self, mission: Mission, mapping: Mapping | None = None) -> None:
        """Create map and planner; with `mapping` the map is one that is kept elsewhere."""
        self._mission = mission
        self.mapping = mapping
        self.planner: Planner | None = None
        self._failures = 0
        self._tiles: Tiles | None = None
        self._goal = mission.leading.route_m[0]
        if mapping is not None:
            self._plan(mapping)

    def aim(self, goal: Point) -> None:
        """Plan to `goal` from now on: the next way-point of the mission."""
        if goal != self._goal:
            self._goal, self._failures = goal, 0
            if self.mapping is not None:
                self._plan(self.mapping)

    def chase(self, goal: Point) -> None:
        """Plan to `goal`, which moves on, with the present route until there is a new one."""
        self._goal = goal
        if self.planner is not None:
            self.planner.goal = goal

    def shown(self, pose: Pose2D) -> Shown | None:
        """Return a tile of the map for views (agents/exploration/map_tiles.py); None if nothing is new."""
        if self.mapping is None:
            return None
        if self._tiles is None:
            self._tiles = Tiles(self.mapping.grid)
        return self._tiles.next(pose.x, pose.y)

    @property
    def route(self) -> tuple[Point, ...]:
        return () if self.planner is None else self.planner.route

    @property
    def failure(self) -> str | None:
        """Reason why the goal cannot be reached, once that is certain; otherwise None."""
        return self.planner.unreachable if self.planner is not None and self._failures >= GIVE_UP_SEARCHES else None

    def see(self, scan: LaserScan, pose: Pose2D, twist: Twist, mates: Sequence[Pose2D]) -> None:
        """Update the map with a scan made at `pose`."""
        if self.mapping is None:
            self._begin(pose)
        assert self.mapping is not None
        if abs(twist.angular_z) < TURNING_RADPS:
            self.mapping.scan(scan, pose, [(mate.x, mate.y) for mate in mates])

    def work(self, leading: bool, pose: Pose2D, mates: Sequence[Pose2D], now: float) -> bool:
        """Do one step's share of mapping and, if leading, of planning; return True when there is a new route."""
        if self.mapping is None or self.planner is None:
            return False
        self.mapping.work(MAP_CELLS)
        if not leading:
            return False
        searches = self.planner.searches
        found = self.planner.work(PLAN_CELLS if self.route else STANDING_PLAN_CELLS, (pose.x, pose.y), mates, now)
        if self.planner.searches != searches:
            self._failures = self._failures + 1 if self.planner.unreachable is not None else 0
        return found

    def free(self, point: Point) -> bool:
        """Return whether the map shows room for the body at `point`, or nothing yet."""
        return self.planner is None or self.planner.free(point)

    def bar(self, place: Point, now: float, *, mate: bool = False) -> None:
        """Plan no route through `place` in `map` for a while: the body does not fit there, or beside a `mate`."""
        if self.planner is not None:
            self.planner.bar(place, now, mate=mate)

    def _begin(self, pose: Pose2D) -> None:
        leading = self._mission.leading
        self.mapping = Mapping(*bounds([(pose.x, pose.y), *leading.route_m], MARGIN_M))
        self._plan(self.mapping)

    def _plan(self, mapping: Mapping) -> None:
        keepout = self._mission.leading.keepout_m
        self.planner = Planner(mapping.grid, self._goal, self._mission.radius_m, keepout, self._mission.half_width_m)
