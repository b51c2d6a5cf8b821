"""Way round a trap: a leader whose detour leads nowhere maps the ground, plans, and returns to its route behind it.

A detour decides by the newest scan alone and has no memory of ground: in a pocket it would turn back and forth. Where
it has won nothing for `PATIENCE_S`, or backs off, a `PlannedWay` leads to the first place ahead on the route that the
map shows free. The map is kept only that long, so that a leader on open ground pays nothing. What the scanner does not
show (a ditch, a step) is not on the map: round that the detour alone leads.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot

from lfa.agents.avoidance.decision import Action, Decision
from lfa.agents.leading.path_follower import PathFollower
from lfa.agents.leading.planned_way import PlannedWay
from lfa.agents.perception.obstacle import ON_THE_MAP
from lfa.agents.perception.scan import Point
from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.messages.team import Slot
from lfa.protocol.mission import Mission

PATIENCE_S, WON_M = 6.0, 0.8
"""Time [s] of a detour that wins less than this progress [m], after which a way round is planned."""
BACK_S = 1.0
"""Time [s] for which a detour backs off, or is blocked on all sides, before a way round is planned."""
AHEAD_M, AHEAD_M_MAX = 1.5, 24.0
"""Distance [m] ahead on the route of the first place to return to; doubled where the return was into the next trap."""
FREE_M, STEP_M = 0.8, 0.4
"""Length [m] of the route that has to be free behind that place, and between two places that are tried."""
AGAIN_M = 4.0
"""Progress [m] from the last return within which a trap counts as the next one."""
BACK_M = 0.35
"""Distance [m] to the place at which the robot has returned to its route."""
MAPPED_S = 0.6
"""Time [s] from the first scan until the map shows the place."""


class WayRound:
    """Way round of one leader: `way` from the trap until the robot is back on its route, else None."""

    def __init__(self, mission: Mission, lead: PathFollower) -> None:
        self._mission = mission
        self._lead = lead
        self._detour: tuple[float, float] | None = None
        """Time [s] and progress [m] since which the present detour has won nothing."""
        self._backs_since: float | None = None
        """Time [s] since which it backs off or is blocked."""
        self._ahead_m = AHEAD_M
        self._returned_m: float | None = None
        self._begun_at = 0.0
        self._back_m: float | None = None
        """Arc length [m] of the place to return to; None before it is chosen, and without a route."""
        self.way: PlannedWay | None = None

    def end(self) -> None:
        """Forget the trap: the robot leads no more, or anew."""
        self.way, self._detour, self._backs_since = None, None, None

    def watch(self, decision: Decision | None, now: float, *, alone: bool = False) -> None:
        """Begin a way round when the present detour leads nowhere; blocked on all sides, only `alone`: in a chain a
        leader that is blocked by its own followers hands over.
        """
        if self.way is not None:
            return
        if decision is None or decision.kind not in ON_THE_MAP:
            self._detour = self._backs_since = None
            return
        progress_m = self._lead.progress_m
        if self._detour is None or progress_m - self._detour[1] >= WON_M:
            self._detour = now, progress_m
        if decision.action is not Action.BACK and not (alone and decision.action is Action.BLOCKED):
            self._backs_since = None
        elif self._backs_since is None:
            self._backs_since = now
        backs = self._backs_since is not None and now - self._backs_since >= BACK_S
        if backs or now - self._detour[0] >= PATIENCE_S:
            again = self._returned_m is not None and progress_m - self._returned_m < AGAIN_M
            self._ahead_m = min(2.0 * self._ahead_m, AHEAD_M_MAX) if again else AHEAD_M
            self.way, self._begun_at, self._back_m = PlannedWay(self._mission, self._lead.waypoint), now, None

    def steer(
        self, points: list[Point], pose: Pose2D, last: Twist, slots: Sequence[Slot], speed_mps: float, now: float
    ) -> Twist | None:
        """Return the twist of the way round; None when there is none, or when it has ended."""
        way = self.way
        if way is None:
            return None
        if self._back_m is None:
            if now - self._begun_at >= MAPPED_S:
                self._aim(way, self._lead.place_m + self._ahead_m)
        elif way.explore.failure is not None:
            self._ahead_m = min(2.0 * self._ahead_m, AHEAD_M_MAX)
            self._aim(way, self._back_m + self._ahead_m)
        elif not self._goes_on(way, self._back_m):
            self._aim(way, self._back_m + STEP_M)
        ended = self._ended(pose)
        if ended or way.explore.failure is not None:
            if ended and self._back_m is not None:
                self._lead.resume(self._back_m, pose)
            self._returned_m = self._lead.progress_m
            self.end()
            return None
        return way.follow(points, pose, way.lead.step(pose, last, slots, speed_mps), now, alone=not slots)

    def _aim(self, way: PlannedWay, from_m: float) -> None:
        """Choose the first place from arc length `from_m` on at which the route goes on, but not behind a way-point
        that can be passed; the goal when there is none. What was not seen yet counts as free, so that a place may have
        to be chosen anew when it is.
        """
        route = self._lead.route
        if route is None:
            return
        end_m = route.length_m
        if self._lead.waypoints_m and way.explore.free(self._lead.waypoint):
            end_m = max(self._lead.waypoints_m[self._lead.waypoint_number], self._lead.place_m)
        at_m = from_m
        while at_m < end_m and not self._goes_on(way, at_m):
            at_m += STEP_M
        at_m = min(at_m, end_m)
        if at_m != self._back_m:
            self._back_m = at_m
            way.aim(route.point(at_m))

    def _goes_on(self, way: PlannedWay, at_m: float) -> bool:
        """Return whether the map shows the route free for `FREE_M` from arc length `at_m`."""
        route = self._lead.route
        if route is None:
            return True
        return all(way.explore.free(route.point(at_m + n * STEP_M)) for n in range(round(FREE_M / STEP_M) + 1))

    def _ended(self, pose: Pose2D) -> bool:
        """Return whether the robot is back on its route, or as near to the goal as makes no difference."""
        goal, route = self._lead.waypoint, self._lead.route
        x, y = goal if route is None or self._back_m is None else route.point(self._back_m)
        return hypot(x - pose.x, y - pose.y) <= BACK_M
