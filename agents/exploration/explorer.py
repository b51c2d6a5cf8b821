"""Unknown ground: every robot maps all the time, so that a new leader starts warm; who leads also plans."""

from __future__ import annotations

from collections.abc import Sequence

from lfa.agents.exploration.map_tiles import Shown, Tiles
from lfa.agents.exploration.occupancy_grid import Mapping, Point, bounds
from lfa.agents.exploration.path_planner import Planner
from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.messages.robot import LaserScan
from lfa.protocol.mission import Mission

MARGIN_M = 15.0
"""Around start and goal: what lies farther out is not mapped, and no route leads through it."""
MAP_CELLS = 400
PLAN_CELLS = 160
"""Budgets of one control step, in cells."""
TURNING_RADPS = 1.0
"""A scan made while the robot turns faster than this is not mapped: its beams have no one pose."""
GIVE_UP_SEARCHES = 3
"""A goal counts as unreachable when so many searches in a row, each on a newer map, have found no way."""


class Explore:
    """Of one robot with one goal. `route` is in `map`; empty while there is none."""

    def __init__(self, mission: Mission) -> None:
        self._mission = mission
        self.mapping: Mapping | None = None
        self.planner: Planner | None = None
        self._failures = 0
        self._tiles: Tiles | None = None

    def shown(self, pose: Pose2D) -> Shown | None:
        """A tile of the map, for views (agents/exploration/map_tiles.py)."""
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
        """Why the goal cannot be reached, once that is certain."""
        return self.planner.unreachable if self.planner is not None and self._failures >= GIVE_UP_SEARCHES else None

    def see(self, scan: LaserScan, pose: Pose2D, twist: Twist, mates: Sequence[Pose2D]) -> None:
        """Take a scan made at `pose` into the map."""
        if self.mapping is None:
            self._begin(pose)
        assert self.mapping is not None
        if abs(twist.angular_z) < TURNING_RADPS:
            self.mapping.scan(scan, pose, [(mate.x, mate.y) for mate in mates])

    def work(self, leading: bool, pose: Pose2D, mates: Sequence[Pose2D], now: float) -> bool:
        """One step's share of mapping and, for who leads, planning; True when there is a new route."""
        if self.mapping is None or self.planner is None:
            return False
        self.mapping.work(MAP_CELLS)
        if not leading:
            return False
        searches = self.planner.searches
        found = self.planner.work(PLAN_CELLS, (pose.x, pose.y), mates, now)
        if self.planner.searches != searches:
            self._failures = self._failures + 1 if self.planner.unreachable is not None else 0
        return found

    def _begin(self, pose: Pose2D) -> None:
        leading = self._mission.leading
        goal = leading.route_m[-1]
        self.mapping = Mapping(*bounds([(pose.x, pose.y), goal], MARGIN_M))
        self.planner = Planner(self.mapping.grid, goal, self._mission.radius_m, leading.keepout_m)
