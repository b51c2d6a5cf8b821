"""Planner of a route through partly known ground: when to search, and when to replace the present route.

If the map contradicts the route, or shows a clearly cheaper one, the search (astar.py) starts anew, also from within a
dead end. costmap.py holds the cost of a step, path_smoothing.py turns cells into a route.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import ceil, cos, hypot, inf, sin

from lfa.agents.exploration.astar import chain, search
from lfa.agents.exploration.costmap import Box, Costmap, between, prices_of, runs_of
from lfa.agents.exploration.occupancy_grid import CELL_M, Grid, Point
from lfa.agents.exploration.path_smoothing import PIECE_M, smoothed, straightened
from lfa.protocol.geometry import Pose2D

MATE_GAP_M = 0.10
"""Clearance [m] to the body of a team-mate that is passed: the way out of a dead end leads past the robots behind."""
MATE_AHEAD_M = 0.8
"""Distance [m] ahead of a team-mate over which it counts as standing everywhere: it drives on while it is passed."""
MATE_STEP_M = 0.2
MATE_NEAR_M = 4.0
CONFLICT_M = 1.5
"""Length [m] of the next part of the route on which a team-mate causes a new search around it."""
CONFLICT_S = 0.4
IMPROVED = 0.85
"""Share of the present route's cost below which a new one replaces it although the present one is still free."""
RENEW_S = 4.0
RETRY_S = 1.0
"""Time [s] between two searches that find nothing."""
ROOMY = 60
"""Cost of a step up to which a robot has room to spare."""
BARRED_M, BARRED_S, MATE_BARRED_S = 0.15, 60.0, 10.0
"""Radius [m] around a place where the body did not fit, and the time [s] for which no route leads through it; less
where a team-mate stood there, which goes on."""
BARRED_AGAIN = 1
"""Number of times that such places are tried once more, where no way is left without them, until the goal counts as
walled in: noise may have barred a gap that the body passes."""
MOVED_M = 0.4
"""Distance [m] of the goal from the end of the route above which a new one is searched."""
CHECK_S = 0.2
"""Period [s] of the check whether the map still agrees with the route."""


class Planner:
    """Planner of one robot with one goal. `route` is the newest, in `map`; `unreachable` is the reason if there is
    none.
    """

    def __init__(
        self, grid: Grid, goal: Point, radius_m: float, keepout: Sequence[Box] = (), half_width_m: float | None = None
    ) -> None:
        self._grid = grid
        self.goal = goal
        """Goal in `map`; where it moves on, the present route holds until a new one is found."""
        self._prices = prices_of(radius_m, half_width_m)
        self._apart_m = 2.0 * radius_m + MATE_GAP_M
        self._keepout = [run for box in keepout for run in runs_of(grid, box)]
        self._search: Iterator[int] | None = None
        self._begun_at = -inf
        self._checked_at = -inf
        self._pose: Point = goal
        self._barred: list[tuple[Point, float]] = []
        self._again = BARRED_AGAIN
        self.route: tuple[Point, ...] = ()
        self.number = 0
        """Number of the route; grows with each new one."""
        self.searches = 0
        """Number of searches that have ended, with or without a route."""
        self.unreachable: str | None = None

    def work(self, cells: int, here: Point, mates: Sequence[Pose2D], now: float) -> bool:
        """Search on for about `cells` cells; return True when there is a new `route` from `here`."""
        self._pose = here
        if self._search is None:
            if now - self._checked_at < CHECK_S:
                return False
            self._checked_at = now
            blocked = not self.route or self.blocked_m(here) is not None
            conflict = self._conflict(here, mates) and now - self._begun_at >= CONFLICT_S
            due = now - self._begun_at >= (RENEW_S if self.route else RETRY_S)
            moved = self._goal_moved() and now - self._begun_at >= RETRY_S
            if not ((blocked and self.route) or conflict or moved or due):
                return False
            self._begun_at = now
            self._barred = [(place, until) for place, until in self._barred if now < until]
            self._search = self._plan(tuple(mates), blocked or conflict or moved)
        number = self.number
        while cells > 0:
            looked = next(self._search, None)
            if looked is None:
                self._search = None
                self.searches += 1
                break
            cells -= looked
        return self.number != number

    def _goal_moved(self) -> bool:
        end = self.route[-1] if self.route else self.goal
        return hypot(end[0] - self.goal[0], end[1] - self.goal[1]) > MOVED_M

    def free(self, point: Point) -> bool:
        """Return whether a robot has room to spare at `point`, as far as the map shows."""
        cell = self._grid.cell(*point)
        return cell is None or 0 < self._prices[self._grid.near[cell]] <= ROOMY

    def bar(self, place: Point, now: float, *, mate: bool = False) -> None:
        """Lead no route through `place` for a while, and drop the present one. `mate`: a team-mate stands there."""
        self._barred.append((place, now + (MATE_BARRED_S if mate else BARRED_S)))
        self.forget()

    def forget(self) -> None:
        """Drop the route and the search; the next `work` starts anew."""
        self.route, self._search = (), None

    def blocked_m(self, here: Point) -> float | None:
        """Return the distance [m] along the rest of the route at which the map blocks it; None when it does not."""
        grid, prices = self._grid, self._prices
        first = _nearest(self.route, here)
        along = 0.0
        for a, b in zip(self.route[first:], self.route[first + 1 :], strict=False):
            for x, y in between(a, b):
                cell = grid.cell(x, y)
                if cell is not None and prices[grid.near[cell]] == 0:
                    return along
            along += hypot(b[0] - a[0], b[1] - a[1])
        return None

    def _conflict(self, here: Point, mates: Sequence[Pose2D]) -> bool:
        """Return whether a team-mate stands on the next part of the route."""
        first = _nearest(self.route, here)
        ahead = self.route[first + 1 : first + 1 + ceil(CONFLICT_M / PIECE_M)]
        line = [point for a, b in pairwise((here, *ahead)) for point in between(a, b)]
        return any(hypot(x - mate.x, y - mate.y) < self._apart_m - 0.05 for mate in mates for x, y in line)

    # --- one search -------------------------------------------------------------------------------------------------

    def _plan(self, mates: tuple[Pose2D, ...], needed: bool) -> Iterator[int]:
        """Search, then turn the cells into a route; set `route` or `unreachable`."""
        costmap = self._costmap(mates)
        goal, start = costmap.settled(self.goal), costmap.settled(self._pose)
        if goal is None:
            self._fail("no robot can stand at the goal", needed)
            return
        if start is None:
            self._fail("no way out of where the robot stands", needed)
            return
        toward = bytearray(len(costmap.near))
        reached = yield from search(costmap, start, goal, toward)
        if not reached and mates:
            yield from self._plan((), needed)
            return
        if not reached and self._barred and self._again > 0:
            self._again -= 1
            self._barred.clear()
            yield from self._plan((), needed)
            return
        if not reached:
            self._fail("the goal is walled in: no way to it is left", needed)
            return
        here = costmap.settled(self._pose)  # the robot has driven on since the search began
        reachable = here is not None and (toward[here] or here == goal)
        cells = chain(toward, self._grid.columns, here if here is not None and reachable else start, goal)
        yield len(cells)
        rest = self.route[_nearest(self.route, self._pose) :]
        old = inf if needed else sum(costmap.price_of_line(a, b) for a, b in pairwise(rest))
        if costmap.price_of_cells(cells) <= IMPROVED * old:
            yield from self._shape(costmap, cells)

    def _shape(self, costmap: Costmap, cells: Sequence[int]) -> Iterator[int]:
        """Set `route` from the cells."""
        points: list[Point] = []
        for looked, so_far in straightened(costmap, cells):
            yield looked
            points = so_far
        points = [self._pose, *points[1:], self.goal] if len(points) > 2 else [self._pose, self.goal]
        for rounder in smoothed(costmap, points):
            yield len(rounder) * 4
            points = rounder
        self.route, self.unreachable = tuple(points), None
        self.number += 1

    def _costmap(self, mates: tuple[Pose2D, ...]) -> Costmap:
        """Return the costmap of the present map, without the keep-out areas and where team-mates are and drive to."""
        costmap = Costmap(self._grid, self._prices)
        costmap.bar_runs(self._keepout)
        for place, _ in self._barred:
            costmap.bar(place, BARRED_M, self._pose)
        for mate in mates:
            apart = hypot(mate.x - self._pose[0], mate.y - self._pose[1])
            if apart < MATE_NEAR_M:
                ahead_m = max(0.0, min(MATE_AHEAD_M, apart - self._apart_m - 2.0 * CELL_M))
                for n in range(int(ahead_m / MATE_STEP_M) + 1):
                    way = n * MATE_STEP_M
                    place = mate.x + way * cos(mate.theta), mate.y + way * sin(mate.theta)
                    costmap.bar(place, self._apart_m, self._pose)
        return costmap

    def _fail(self, why: str, needed: bool) -> None:
        if needed:
            self.route, self.unreachable = (), why


def _nearest(route: Sequence[Point], here: Point) -> int:
    return min(range(len(route)), key=lambda n: (route[n][0] - here[0]) ** 2 + (route[n][1] - here[1]) ** 2, default=0)
