"""Way of a leader that plans for itself: map, planner, and the arcs that follow the route among what the scan shows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import inf

from msgspec.structs import replace

from lfa.agents.avoidance.arc_planner import ArcPlanner
from lfa.agents.avoidance.square_entry import SquareEntry
from lfa.agents.exploration.explorer import Explore
from lfa.agents.exploration.occupancy_grid import Mapping
from lfa.agents.following.factory import heading_filter_of
from lfa.agents.leading.path_follower import PathFollower
from lfa.agents.perception.footprint import PolygonBody
from lfa.agents.perception.scan import Point, without
from lfa.agents.recovery.run_up import RunUp
from lfa.protocol.geometry import STILL, Pose2D, Twist, distance, in_base
from lfa.protocol.mission import Mission

TEAM_RADPS = 0.5
"""Turn rate [rad/s] before what blocks the way, with slots that swing around the robot."""
BLOCKED_S = 1.5
"""Time [s] before a gap that no arc leads through, after which its place is barred and another way is searched. It runs
on until the robot is its own radius away: an arc that the next scan shows closed again leads nowhere.
"""
ENTERS_S = 30.0
"""Time [s] for which a polygon enters passages squarely after no arc led on: where arcs do, they are faster, and turn
it less among what its scanner does not look at.
"""
ROOM_S = 8.0
"""The same time [s] where a team-mate stands there, which makes room (`behaviors/make_room.py`)."""
MATE_M = 0.15
"""Distance [m] beyond the body of a team-mate up to which a point of the scan is that team-mate."""


class PlannedWay:
    """Planned way of one robot to one goal: that of its mission, or the point at which it returns to its route."""

    def __init__(self, mission: Mission, goal: Point | None = None, mapping: Mapping | None = None) -> None:
        """Create a way; with `mapping` it plans on that map, which another part of the robot keeps."""
        route_m = mission.leading.route_m if goal is None else (goal,)
        leading = replace(mission.leading, motion="explore", route_m=route_m)
        self.explore = Explore(replace(mission, leading=leading), mapping)
        swings = heading_filter_of(mission) == 0.0
        self.lead = PathFollower(
            leading, mission.limits, mission.radius_m, mission.control_period_s, slots_swing=swings
        )
        self._radius_m = mission.radius_m
        footprint = PolygonBody.of(mission)
        self._arcs = ArcPlanner(mission.radius_m, mission.limits, footprint)
        self._run_up = None if footprint is None else RunUp()
        self._entry = None if footprint is None else SquareEntry(mission.radius_m, mission.half_width_m, mission.limits)
        """Run-ups of a polygon, and its entry into what is narrower than its circle; a round body needs none."""
        self._enters_until = -inf
        """Time [s] until which the entry leads: from where no arc led on."""
        self._blocked: tuple[float, Pose2D] | None = None
        """Time [s] and place at which no arc led on first; None since the robot has left it."""
        self._mates: Sequence[Pose2D] = ()

    def work(self, leads: bool, pose: Pose2D, mates: Sequence[Pose2D], now: float) -> None:
        """Do one step's share of mapping and, if leading, of planning."""
        self._mates = mates
        if self.explore.work(leads, pose, mates, now):
            self.lead.take(self.explore.route, pose)

    def aim(self, goal: Point) -> None:
        """Lead to another goal in `map` [m] from now on."""
        self.explore.aim(goal)
        self.lead.end_at(goal)

    def chase(self, goal: Point) -> None:
        """Lead to a goal in `map` [m] that moves on: the present route holds until a new one is found."""
        self.explore.chase(goal)
        self.lead.end_at(goal)

    def follow(self, points: list[Point], pose: Pose2D, wanted: Twist, now: float, *, alone: bool) -> Twist:
        """Follow the planned route through what the scan shows; give up a gap that the body does not fit through.

        `wanted` is the twist of `lead`; `points` are in `base_link`; `alone` is False with slots that swing around the
        robot as it turns.
        """
        if not self.explore.route:
            return STILL
        swing = self.lead.slots_swing and not alone
        turn_radps = TEAM_RADPS if swing else inf
        route: Callable[[float], Point] = partial(self.lead.ahead, pose)
        if self._entry is not None and now < self._enters_until:
            speed_mps = self.lead.bend_mps(0.0)
            route, wanted = self._entry.lead(points, pose, route, wanted, speed_mps, turn_radps, now)
        twist = self._arcs.steer(points, route, wanted, turn_radps, self.lead.bend_mps)
        if self._arcs.blocked:
            self._enters_until = now + ENTERS_S
        if self._run_up is not None:
            backs = self._run_up.step(pose, self._arcs.back(points), blocked=self._arcs.blocked)
            if backs is not None:
                return backs
        if self._blocked is not None and distance(self._blocked[1], pose) > self._radius_m:
            self._blocked = None
        if self._arcs.blocked:
            if self._blocked is None:
                self._blocked = now, pose
            waits = self._mate_blocks(points, pose, wanted, turn_radps)
            if now - self._blocked[0] >= (ROOM_S if waits else BLOCKED_S):
                self._blocked = None
                self.explore.bar(self.lead.point(self._radius_m), now, mate=waits)
            elif waits:
                return STILL
        return twist

    def _mate_blocks(self, points: list[Point], pose: Pose2D, wanted: Twist, turn_radps: float) -> bool:
        """Return whether an arc leads on but for the team-mates."""
        others = points
        for mate in self._mates:
            others = without(others, in_base(pose, (mate.x, mate.y)), self._radius_m + MATE_M)
        if len(others) == len(points):
            return False
        self._arcs.steer(others, partial(self.lead.ahead, pose), wanted, turn_radps, self.lead.bend_mps)
        return not self._arcs.blocked
