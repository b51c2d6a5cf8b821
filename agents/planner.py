"""A route through ground that is known in part: A* from the goal to the robot, on a robot's own occupancy grid.

Ground that nobody has seen can be driven at a price, so the route leads on into the unknown; near what is known to be
occupied the price grows, so it keeps to the middle where there is room. When the map comes to contradict the route, or
knows a clearly cheaper one, the search begins anew: out of a dead end too. Backwards, because a goal that is walled
in is then found out after its own small room, not after the rest of the world. A search is a generator that
gives the cells it has looked at, so it goes on in the next tick where the budget ended this one.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from heapq import heappop, heappush
from itertools import pairwise
from math import ceil, cos, hypot, inf, sin

from agents.mapping import CELL_M, NEAR_PER_CELL, REACH, Grid, Point
from protocol.geometry import Pose2D

FREE, UNSEEN = 10, 13
"""Price of a straight step; a diagonal one costs `DIAGONAL` / `STRAIGHT` as much."""
STRAIGHT, DIAGONAL = 5, 7
GUESS = 11
"""Of the way still to go, a step: a little above `FREE`, so that unknown ground is not searched in its whole width."""
SKIN_M = 0.04
"""The way's middle stays so much farther than the radius from an occupied cell's centre than half a cell."""
CLOSE = 60
"""Added to the price of a step just not touching, falling with the square of the clearance gained."""
ROOM_M = 0.45
"""Clearance beyond which more is worth nothing."""
MATE_GAP_M = 0.10
"""Kept from the skin of a team-mate that is gone round: out of a dead end the way leads past those behind."""
MATE_AHEAD_M = 0.8
"""A team-mate counts as standing all along so far before it: it comes on while it is passed."""
MATE_STEP_M = 0.2
MATE_NEAR_M = 4.0
CONFLICT_M = 1.5
"""A team-mate on the next part of the route, of this length, is gone round."""
CONFLICT_S = 0.4
LOOKED_PER_YIELD = 16
PIECE_M = 0.4
"""Between the points of a route; a cut corner is rounded over several."""
SMOOTHINGS = 12
CUT_MAX = 48
"""A shortcut replaces at most so many cells of path."""
IMPROVED = 0.85
"""Share of the old route's price below which a new one is taken although the old one is still open."""
RENEW_S = 4.0
RETRY_S = 1.0
"""Between two searches that find nothing."""
CHECK_S = 0.2
"""Between two looks at whether the map still agrees with the route."""
LONG_CELLS, ROOM_CELLS_MAX = 12_000, 60_000
"""A search that has looked at so many cells asks whether the robot is walled in, in a room of at most so many."""
SETTLE_CELLS = 6
"""How far from a barred start or goal a free cell is looked for."""


class Planner:
    """Of one robot with one goal. `route` is the newest, in `map`; `unreachable` says why there is none."""

    def __init__(
        self, grid: Grid, goal: Point, radius_m: float, keepout: Sequence[tuple[float, float, float, float]] = ()
    ) -> None:
        self._grid = grid
        self._goal = goal
        self._prices = _prices(radius_m)
        self._apart_m = 2.0 * radius_m + MATE_GAP_M
        self._keepout = [run for box in keepout for run in _runs(grid, box)]
        self._search: Iterator[int] | None = None
        self._begun_at = -inf
        self._checked_at = -inf
        self._pose: Point = goal
        self.route: tuple[Point, ...] = ()
        self.number = 0
        """Grows with each new route."""
        self.searches = 0
        """Ended so far, with or without a route."""
        self.unreachable: str | None = None

    def work(self, cells: int, here: Point, mates: Sequence[Pose2D], now: float) -> bool:
        """Look at about so many cells more; True when there is a new `route` from `here`."""
        self._pose = here
        if self._search is None:
            if now - self._checked_at < CHECK_S:
                return False
            self._checked_at = now
            blocked = not self.route or self.blocked_m(here) is not None
            conflict = self._conflict(here, mates) and now - self._begun_at >= CONFLICT_S
            due = now - self._begun_at >= (RENEW_S if self.route else RETRY_S)
            if not ((blocked and self.route) or conflict or due):
                return False
            self._begun_at = now
            self._search = self._plan(tuple(mates), blocked or conflict)
        number = self.number
        while cells > 0:
            looked = next(self._search, None)
            if looked is None:
                self._search = None
                self.searches += 1
                break
            cells -= looked
        return self.number != number

    def forget(self) -> None:
        """Begin anew at the next `work`."""
        self.route, self._search = (), None

    def blocked_m(self, here: Point) -> float | None:
        """How far along the rest of the route the map bars it; None when it does not."""
        grid, prices = self._grid, self._prices
        first = _nearest(self.route, here)
        along = 0.0
        for a, b in zip(self.route[first:], self.route[first + 1 :], strict=False):
            for x, y in _between(a, b):
                cell = grid.cell(x, y)
                if cell is not None and prices[grid.near[cell]] == 0:
                    return along
            along += hypot(b[0] - a[0], b[1] - a[1])
        return None

    def _conflict(self, here: Point, mates: Sequence[Pose2D]) -> bool:
        """A team-mate stands on the next part of the route."""
        first = _nearest(self.route, here)
        ahead = self.route[first + 1 : first + 1 + ceil(CONFLICT_M / PIECE_M)]
        line = [point for a, b in pairwise((here, *ahead)) for point in _between(a, b)]
        return any(hypot(x - mate.x, y - mate.y) < self._apart_m - 0.05 for mate in mates for x, y in line)

    # --- one search -------------------------------------------------------------------------------------------------

    def _plan(self, mates: tuple[Pose2D, ...], needed: bool) -> Iterator[int]:
        """Search, then make a route of the cells; set `route` or `unreachable`."""
        field = self._field(mates)
        goal = self._settled(field, self._goal)
        start = self._settled(field, self._pose)
        if goal is None:
            self._fail("no robot can stand at the goal", needed)
            return
        if start is None:
            self._fail("no way out of where the robot stands", needed)
            return
        toward, reached = bytearray(len(field)), False
        looked_at, asked = 0, False
        for looked in self._spread(field, goal, start, toward):
            reached = reached or looked < 0
            looked_at += abs(looked)
            yield abs(looked)
            if looked_at > LONG_CELLS and not asked:
                asked = True
                if (yield from self._closed_in(field, start, goal)):
                    break
        if not reached and mates:
            yield from self._plan((), needed)
            return
        if not reached:
            self._fail("the goal is walled in: no way to it is left", needed)
            return
        here = self._settled(field, self._pose)
        reachable = here is not None and (toward[here] or here == goal)
        cells = _chain(toward, self._grid.columns, here if here is not None and reachable else start, goal)
        yield len(cells)
        rest = self.route[_nearest(self.route, self._pose) :]
        old = inf if needed else sum(self._price_of_line(field, a, b) for a, b in pairwise(rest))
        if self._price_of_cells(field, cells) > IMPROVED * old:
            return
        points: list[Point] = []
        for part in self._straightened(field, cells):
            yield part[0]
            points = part[1]
        points = [self._pose, *points[1:], self._goal] if len(points) > 2 else [self._pose, self._goal]
        for smoothed in self._smoothed(field, points):
            yield len(smoothed) * 4
            points = smoothed
        self.route, self.unreachable = tuple(points), None
        self.number += 1

    def _field(self, mates: tuple[Pose2D, ...]) -> bytearray:
        """Nearness as it is now: the map may change while the search goes on, the search's ground does not."""
        field = bytearray(self._grid.near)
        for low, high in self._keepout:
            field[low:high] = bytes([NEAR_PER_CELL * REACH]) * (high - low)
        for mate in mates:
            apart = hypot(mate.x - self._pose[0], mate.y - self._pose[1])
            if apart < MATE_NEAR_M:
                ahead_m = max(0.0, min(MATE_AHEAD_M, apart - self._apart_m - 2.0 * CELL_M))
                for n in range(int(ahead_m / MATE_STEP_M) + 1):
                    way = n * MATE_STEP_M
                    self._bar(field, (mate.x + way * cos(mate.theta), mate.y + way * sin(mate.theta)))
        return field

    def _bar(self, field: bytearray, center: Point) -> None:
        """No way within a team-mate's distance of `center`, but for where the robot itself stands."""
        grid, cell = self._grid, self._grid.cell(*center)
        if cell is None:
            return
        reach = min(REACH, int(self._apart_m / CELL_M))
        own_x, own_y = self._pose
        for row in range(-reach, reach + 1):
            for column in range(-reach, reach + 1):
                if hypot(row, column) * CELL_M <= self._apart_m:
                    place = cell + row * grid.columns + column
                    x, y = grid.center(place)
                    if hypot(x - own_x, y - own_y) > 2.0 * CELL_M:
                        field[place] = NEAR_PER_CELL * REACH

    def _settled(self, field: bytearray, point: Point) -> int | None:
        """The nearest cell to `point` that a robot can stand in, within `SETTLE_CELLS`."""
        cell = self._grid.cell(*point)
        if cell is None:
            return None
        reach = range(-SETTLE_CELLS, SETTLE_CELLS + 1)
        around = (
            (row * row + column * column, cell + row * self._grid.columns + column) for row in reach for column in reach
        )
        return min((pair for pair in around if self._prices[field[pair[1]]] > 0), default=(0, None))[1]

    def _spread(self, field: bytearray, goal: int, start: int, toward: bytearray) -> Iterator[int]:
        """A* from `goal`: `toward[cell]` becomes the number, from 1, of the step by which the cell was reached. Ends
        with a negative number when `start` is reached, else when nothing is left."""
        columns, prices, scores = self._grid.columns, self._prices, self._grid.scores
        steps = tuple(
            (number, offset, DIAGONAL if abs(offset) not in (1, columns) else STRAIGHT)
            for number, offset in enumerate(_offsets(columns), start=1)
        )
        best = memoryview(bytearray(4 * len(field))).cast("i")
        closed = bytearray(len(field))
        start_row, start_column = divmod(start, columns)
        rim = (REACH, self._grid.rows - REACH)
        heap = [goal]
        best[goal] = 1
        looked = 0
        while heap:
            cell = heappop(heap) & 0xFFFFFF
            if closed[cell]:
                continue
            closed[cell] = 1
            if cell == start:
                yield -1 - looked
                return
            looked += 1
            if looked == LOOKED_PER_YIELD:
                yield looked
                looked = 0
            row, column = divmod(cell, columns)
            if not (rim[0] <= row < rim[1] and REACH <= column < columns - REACH):
                continue
            cost = best[cell]
            for number, offset, length in steps:
                other = cell + offset
                if closed[other]:
                    continue
                price = prices[field[other]]
                if price == 0:
                    continue
                if scores[other] == 0:
                    price += UNSEEN - FREE
                total = cost + length * price
                known = best[other]
                if known == 0 or total < known:
                    best[other] = total
                    toward[other] = number
                    row, column = divmod(other, columns)
                    dr, dc = abs(row - start_row), abs(column - start_column)
                    guess = GUESS * (STRAIGHT * max(dr, dc) + (DIAGONAL - STRAIGHT) * min(dr, dc))
                    heappush(heap, (total + guess) << 24 | other)
        yield looked

    def _closed_in(self, field: bytearray, start: int, goal: int) -> Generator[int, None, bool]:
        """Whether the ground around the robot ends before the goal: a long search would find that out last."""
        prices, columns = self._prices, self._grid.columns
        seen = bytearray(len(field))
        seen[start] = 1
        cells = [start]
        for cell in cells:
            if cell == goal or len(cells) > ROOM_CELLS_MAX:
                return False
            row, column = divmod(cell, columns)
            if not (REACH <= row < self._grid.rows - REACH and REACH <= column < columns - REACH):
                return False
            for other in (cell + 1, cell - 1, cell + columns, cell - columns):
                if not seen[other] and prices[field[other]]:
                    seen[other] = 1
                    cells.append(other)
            yield 1
        return True

    def _fail(self, why: str, needed: bool) -> None:
        if needed:
            self.route, self.unreachable = (), why

    # --- from cells to a route that can be driven ---------------------------------------------------------------

    def _straightened(self, field: bytearray, cells: Sequence[int]) -> Iterator[tuple[int, list[Point]]]:
        """Shortcuts where the straight line is not dearer than the cells it replaces; work and points so far."""
        grid = self._grid
        at = 0
        points = [grid.center(cells[0])]
        while at < len(cells) - 1:
            looked, to, span = 0, at + 1, min(CUT_MAX, len(cells) - 1 - at)
            while span > 1:
                looked += 2 * span
                straight = self._price_of_line(field, grid.center(cells[at]), grid.center(cells[at + span]))
                if straight <= self._price_of_cells(field, cells[at : at + span + 1]) + 0.5 * FREE * STRAIGHT:
                    to = at + span
                    break
                span //= 2
            a, b = grid.center(cells[at]), grid.center(cells[to])
            pieces = max(1, ceil(hypot(b[0] - a[0], b[1] - a[1]) / PIECE_M))
            points += [
                (a[0] + (b[0] - a[0]) * n / pieces, a[1] + (b[1] - a[1]) * n / pieces) for n in range(1, pieces + 1)
            ]
            at = to
            yield looked, points

    def _smoothed(self, field: bytearray, points: list[Point]) -> Iterator[list[Point]]:
        """Each point drawn to the middle of its neighbours, as far as that brings it no nearer to a wall."""
        for _ in range(SMOOTHINGS):
            for n in range(1, len(points) - 1):
                (ax, ay), (x, y), (bx, by) = points[n - 1 : n + 2]
                moved = 0.5 * x + 0.25 * (ax + bx), 0.5 * y + 0.25 * (ay + by)
                if self._price(field, moved) <= max(self._price(field, (x, y)), FREE + 6):
                    points[n] = moved
            yield points

    def _price(self, field: bytearray, point: Point) -> int:
        cell = self._grid.cell(*point)
        price = 0 if cell is None else self._prices[field[cell]]
        return price or 1000

    def _price_of_cells(self, field: bytearray, cells: Sequence[int]) -> int:
        """Of a chain of neighbours, as `_spread` counts."""
        prices, scores, straight = self._prices, self._grid.scores, (1, self._grid.columns)
        return sum(
            (prices[field[cell]] + (UNSEEN - FREE if scores[cell] == 0 else 0))
            * (STRAIGHT if abs(cell - last) in straight else DIAGONAL)
            for last, cell in pairwise(cells)
        )

    def _price_of_line(self, field: bytearray, a: Point, b: Point) -> float:
        """Of the straight way, by its length; inf when it is barred."""
        total, count = 0, 0
        for x, y in _between(a, b):
            cell = self._grid.cell(x, y)
            price = 0 if cell is None else self._prices[field[cell]]
            if cell is None or price == 0:
                return inf
            total += price + (UNSEEN - FREE if self._grid.scores[cell] == 0 else 0)
            count += 1
        return STRAIGHT * total / count * hypot(b[0] - a[0], b[1] - a[1]) / CELL_M


def _prices(radius_m: float) -> bytes:
    """Price of a straight step by nearness; 0: barred."""
    barred_m = radius_m + 0.5 * CELL_M + SKIN_M
    prices = []
    for near in range(256):
        clear_m = (REACH - near / NEAR_PER_CELL) * CELL_M
        lacking = min(1.0, max(0.0, (barred_m + ROOM_M - clear_m) / ROOM_M))
        prices.append(0 if near and clear_m < barred_m - 1e-9 else round(FREE + CLOSE * lacking * lacking))
    return bytes(prices)


def _offsets(columns: int) -> tuple[int, ...]:
    return tuple(row * columns + column for row in (-1, 0, 1) for column in (-1, 0, 1) if row or column)


def _chain(toward: bytearray, columns: int, start: int, goal: int) -> list[int]:
    """The cells from `start` to `goal`, each step of the search taken back."""
    offsets, cells = _offsets(columns), [start]
    while cells[-1] != goal:
        cells.append(cells[-1] - offsets[toward[cells[-1]] - 1])
    return cells


def _between(a: Point, b: Point) -> Iterator[Point]:
    """Points from `a` to `b`, one every cell's length."""
    steps = max(1, ceil(hypot(b[0] - a[0], b[1] - a[1]) / CELL_M))
    return ((a[0] + (b[0] - a[0]) * n / steps, a[1] + (b[1] - a[1]) * n / steps) for n in range(1, steps + 1))


def _nearest(route: Sequence[Point], here: Point) -> int:
    return min(range(len(route)), key=lambda n: (route[n][0] - here[0]) ** 2 + (route[n][1] - here[1]) ** 2, default=0)


def _runs(grid: Grid, box: tuple[float, float, float, float]) -> Iterator[tuple[int, int]]:
    """The cells of a box as runs of indices."""
    x1, y1, x2, y2 = box
    low = max(0, int((x1 - grid.x0_m) / CELL_M)), max(0, int((y1 - grid.y0_m) / CELL_M))
    high = min(grid.columns, ceil((x2 - grid.x0_m) / CELL_M)), min(grid.rows, ceil((y2 - grid.y0_m) / CELL_M))
    if low[0] < high[0]:
        for row in range(low[1], high[1]):
            yield row * grid.columns + low[0], row * grid.columns + high[0]
