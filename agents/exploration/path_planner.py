"""Planner of a route through partly known ground: when to search, and when to replace the present route.

Where the map contradicts the route, a search forward finds another one on the newest map, also out of a dead end. Its
heuristic is the cost to go, which a search backward renews all the time, over many control steps (astar.py): that alone
would answer with a map of ten seconds ago. costmap.py holds the cost of a step, path_smoothing.py turns cells into a
route.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from itertools import pairwise
from math import ceil, cos, hypot, inf, sin

from lfa.agents.exploration.astar import CostToGo, forward, search
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
PASSED_CELLS = 12
"""Number of a new way's first cells that the robot may have passed while it was searched."""
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
        self._renewal: Iterator[int] | None = None
        self._to_go: CostToGo | None = None
        """Newest cost to go, to the goal `_to_go_goal`; None before the first."""
        self._to_go_goal: Point = goal
        self._renewed = False
        """True since the cost to go is newer than the last search."""
        self._begun_at = self._renewed_at = -inf
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
        """Search on for about `cells` cells; return True when there is a new `route` from `here`.

        A search for a way that is needed comes first. What it leaves of the budget renews the cost to go, on which the
        next ones rest; whether there is a cheaper way is asked when that is done.
        """
        self._pose = here
        if self._search is None and now - self._checked_at >= CHECK_S:
            self._checked_at = now
            self._search = self._due(tuple(mates), now)
        if self._renewal is None and self._to_go is not None and now - self._renewed_at >= RENEW_S:
            self._renewed_at = now
            self._renewal = self._renew()
        number = self.number
        while cells > 0 and (running := self._search or self._renewal) is not None:
            looked = next(running, None)
            if looked is not None:
                cells -= looked
            elif running is self._search:
                self._search = None
                self.searches += 1
            else:
                self._renewal = None
        return self.number != number

    def _due(self, mates: tuple[Pose2D, ...], now: float) -> Iterator[int] | None:
        """Return a new search for a way where one is due."""
        since_s = now - self._begun_at
        blocked = self.blocked_m(self._pose) is not None
        conflict = since_s >= CONFLICT_S and self._conflict(self._pose, mates)
        moved = since_s >= RETRY_S and self._goal_moved()
        lacking = not self.route and since_s >= RETRY_S
        if not (blocked or conflict or moved or lacking or self._renewed):
            return None
        self._begun_at, self._renewed = now, False
        self._barred = [(place, until) for place, until in self._barred if now < until]
        return self._plan(mates, blocked or conflict or moved or lacking)

    def _goal_moved(self) -> bool:
        return bool(self.route) and _apart(self.route[-1], self.goal) > MOVED_M

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
        self.route, self._search, self._begun_at = (), None, -inf

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
        """Search a way by the cost to go, which is found first where there is none or it misleads; set `route` or
        `unreachable`.
        """
        cells: list[int] = []
        if self._to_go is not None and _apart(self._to_go_goal, self.goal) <= MOVED_M:
            cells = yield from self._way(mates)
        if not cells:
            self._renewal = None
            if not needed or not (yield from self._estimate(needed=True)):
                return
            cells = yield from self._way(mates)
        if cells:
            costmap = self._costmap(())  # whether a team-mate stands on the present route is another question
            rest = self.route[_nearest(self.route, self._pose) :]
            old = inf if needed else sum(costmap.price_of_line(a, b) for a, b in pairwise(rest))
            if costmap.price_of_cells(cells) <= IMPROVED * old:
                yield from self._shape(self._costmap(mates), cells)

    def _way(self, mates: tuple[Pose2D, ...]) -> Generator[int, None, list[int]]:
        """Return the cells of the cheapest way on the present map, past the team-mates where one leads past them."""
        costmap, cells = self._costmap(mates), list[int]()
        start = costmap.settled(self._pose)
        if start is not None and self._to_go is not None:
            cells = yield from forward(costmap, start, self._to_go)
        if not cells and mates:
            return (yield from self._way(()))
        passed = min(
            range(min(len(cells), PASSED_CELLS)),
            key=lambda n: _apart(self._grid.center(cells[n]), self._pose),
            default=0,
        )
        return cells[passed:]  # the robot has driven on since the search began

    def _renew(self) -> Iterator[int]:
        """Renew the cost to go while the robot drives; then a way that is much cheaper may replace the present one."""
        self._renewed = yield from self._estimate(needed=False)

    def _estimate(self, *, needed: bool) -> Generator[int, None, bool]:
        """Find the cost to go on the map without the team, which goes on; return whether there is a way. Sets
        `unreachable` when there is none and one is `needed`.
        """
        costmap, place = self._costmap(()), self.goal
        goal, start = costmap.settled(place), costmap.settled(self._pose)
        if goal is None or start is None:
            lacks = "no robot can stand at the goal" if goal is None else "no way out of where the robot stands"
            self._fail(lacks, needed)
            return False
        to_go = CostToGo(self._grid, goal)
        if (yield from search(costmap, start, to_go)):
            self._to_go, self._to_go_goal = to_go, place
            return True
        if self._barred and self._again > 0:
            self._again -= 1
            self._barred.clear()
            return (yield from self._estimate(needed=needed))
        self._fail("the goal is walled in: no way to it is left", needed)
        return False

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


def _apart(a: Point, b: Point) -> float:
    return hypot(a[0] - b[0], a[1] - b[1])
