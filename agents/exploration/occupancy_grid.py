"""Occupancy grid of one robot, from its own scans, with the clearance of each cell.

Each cell has a score: 0 unknown, 1..7 free, 8..15 occupied. A beam that ends in a cell adds `HIT`, one that passes
subtracts 1, so that obstacles that moved away and stray readings are forgotten. Clearance is a distance transform up to
`REACH` cells, stamped around a cell when it becomes occupied and computed anew around one that becomes free. All work
is done in `work`, by a budget in cells: no call takes longer because the map is larger.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from math import ceil, cos, floor, hypot, inf, sin

from lfa.agents.perception.scan import READING_M_MIN
from lfa.protocol.geometry import Pose2D
from lfa.protocol.messages.robot import LaserScan

CELL_M = 0.1
SIDE_CELLS_MAX = 1200
"""Maximum side [cells] of a grid; larger ground is cut off there."""
REACH = 8
"""Maximum clearance [cells] that is computed."""
NEAR_PER_CELL = 10
OCCUPIED = 8
HIT, FIRST_HIT, FIRST_MISS, SCORE_MAX = 4, 9, 4, 15
SIGHT_M = 6.0
SHORT_OF_HIT_M = 0.2
"""Length [m] of a beam's last part, which frees no cell: a beam along a wall would otherwise erase the wall."""
RAYS_MAX = 180
MATE_M = 0.5
"""Radius [m] around a team-mate's last known position in which no cell is marked occupied."""
REMAKE_COST = 1500
"""Cost [cells of the budget] of computing the clearance anew around one freed cell."""
CHANGES_MAX = 4096

Point = tuple[float, float]

_HIT = bytes([FIRST_HIT, *(min(SCORE_MAX, score + HIT) for score in range(1, 256))])
_MISS = bytes([FIRST_MISS, *(max(1, score - 1) for score in range(1, 256))])


class Grid:
    """Bounded grid whose outer `REACH` cells stay unknown. Untouched memory costs nothing."""

    def __init__(self, low: Point, high: Point) -> None:
        """Create a grid over the box from `low` to `high` in `map` [m], cut to `SIDE_CELLS_MAX` cells a side."""
        self.x0_m, self.y0_m = floor(low[0] / CELL_M) * CELL_M, floor(low[1] / CELL_M) * CELL_M
        self.columns = min(ceil((high[0] - self.x0_m) / CELL_M) + 1, SIDE_CELLS_MAX)
        self.rows = min(ceil((high[1] - self.y0_m) / CELL_M) + 1, SIDE_CELLS_MAX)
        self.scores = bytearray(self.columns * self.rows)
        self.near = bytearray(self.columns * self.rows)
        """Nearness: `NEAR_PER_CELL` (REACH - distance to the nearest occupied cell's centre in cells); 0: none in
        reach."""
        self.stamp = _stamp(self.columns)

    def cell(self, x: float, y: float) -> int | None:
        """Return the index of the cell of a point in `map`; None in the rim and beyond."""
        column, row = floor((x - self.x0_m) / CELL_M), floor((y - self.y0_m) / CELL_M)
        inside = REACH <= column < self.columns - REACH and REACH <= row < self.rows - REACH
        return row * self.columns + column if inside else None

    def center(self, cell: int) -> Point:
        row, column = divmod(cell, self.columns)
        return self.x0_m + (column + 0.5) * CELL_M, self.y0_m + (row + 0.5) * CELL_M

    def occupied(self, cell: int) -> bool:
        return self.scores[cell] >= OCCUPIED

    def clearance_m(self, cell: int) -> float:
        """Return the distance [m] to the nearest occupied cell's centre, at most `REACH` cells."""
        return (REACH - self.near[cell] / NEAR_PER_CELL) * CELL_M


class Mapping:
    """Mapping of one robot from its scans; `grid` is the map so far."""

    def __init__(self, low: Point, high: Point) -> None:
        self.grid = Grid(low, high)
        self._rays: Iterator[int] | None = None
        self._taken: deque[int] = deque()
        self._freed: deque[int] = deque()

    def scan(self, scan: LaserScan, pose_map: Pose2D, mates: Sequence[Point]) -> bool:
        """Accept a scan made at `pose_map`; return False, without effect, while the last one is still being
        processed.
        """
        if self._rays is not None:
            return False
        self._rays = self._trace(scan, pose_map, tuple(mates))
        return True

    def work(self, cells: int) -> None:
        """Continue the pending work, for about `cells` cells."""
        grid = self.grid
        while cells > 0 and self._taken:
            _raise(grid.near, grid.stamp, self._taken.popleft())
            cells -= len(grid.stamp)
        while cells > 0 and self._freed:
            _remake(grid, self._freed.popleft())
            cells -= REMAKE_COST
        while cells > 0 and self._rays is not None:
            done = next(self._rays, None)
            if done is None:
                self._rays = None
            else:
                cells -= done

    def _trace(self, scan: LaserScan, pose: Pose2D, mates: tuple[Point, ...]) -> Iterator[int]:
        """Process one beam per step; yield the number of cells that it passed."""
        count, low_m = len(scan.ranges_m), max(scan.range_min_m, READING_M_MIN)
        for n in range(0, count, max(1, ceil(count / RAYS_MAX))):
            r = scan.ranges_m[n]
            if r != r or r < low_m:  # noqa: PLR0124 (nan, at a third of the cost of isnan)
                continue
            angle = pose.theta + scan.angle_min + n * scan.angle_increment
            c, s = cos(angle), sin(angle)
            hits = r < min(scan.range_max_m, SIGHT_M)
            if r == inf and min(scan.ranges_m[n - 1], scan.ranges_m[(n + 1) % count]) < SIGHT_M:
                continue  # no echo between beams with one: the cells along it stay unknown
            free_m = r - SHORT_OF_HIT_M if hits else min(scan.range_max_m, SIGHT_M)
            if hits:
                x, y = pose.x + r * c, pose.y + r * s
                if _beside(x, y, mates):
                    free_m, hits = r - MATE_M, False
                else:
                    cell = self.grid.cell(x, y)
                    if cell is not None:
                        self._hit(cell)
            yield self._free(pose.x, pose.y, c, s, free_m) + 4

    def _hit(self, cell: int) -> None:
        scores = self.grid.scores
        score = scores[cell]
        scores[cell] = _HIT[score]
        if score < OCCUPIED <= scores[cell] and len(self._taken) < CHANGES_MAX:
            self._taken.append(cell)

    def _free(self, x: float, y: float, c: float, s: float, length_m: float) -> int:
        """Mark the cells along a beam free; return its length in cells. Cells outside of the grid are skipped."""
        grid, scores, columns = self.grid, self.grid.scores, self.grid.columns
        steps = int(length_m / CELL_M)
        if steps <= 0 or grid.cell(x, y) is None:
            return 0
        px, py = (x - grid.x0_m) / CELL_M, (y - grid.y0_m) / CELL_M
        inside = steps if grid.cell(x + c * length_m, y + s * length_m) is not None else _inside(grid, px, py, c, s)
        for _ in range(min(steps, inside)):
            cell = int(py) * columns + int(px)
            score = scores[cell]
            scores[cell] = _MISS[score]
            if score == OCCUPIED and len(self._freed) < CHANGES_MAX:
                self._freed.append(cell)
            px += c
            py += s
        return steps


def bounds(points: Sequence[Point], margin_m: float) -> tuple[Point, Point]:
    """Return the lower left and upper right corner of the box around `points`, enlarged by `margin_m`."""
    xs, ys = [point[0] for point in points], [point[1] for point in points]
    return (min(xs) - margin_m, min(ys) - margin_m), (max(xs) + margin_m, max(ys) + margin_m)


def _beside(x: float, y: float, mates: tuple[Point, ...]) -> bool:
    return any((x - mx) * (x - mx) + (y - my) * (y - my) < MATE_M * MATE_M for mx, my in mates)


def _inside(grid: Grid, px: float, py: float, c: float, s: float) -> int:
    """Return how many steps of one cell along (c, s) stay within the rim."""
    most = float(grid.columns + grid.rows)
    for place, step, side in ((px, c, grid.columns), (py, s, grid.rows)):
        if step > 1e-9:
            most = min(most, (side - REACH - place) / step)
        elif step < -1e-9:
            most = min(most, (REACH - place) / step)
    return max(0, int(most))


def _stamp(columns: int) -> tuple[tuple[int, int], ...]:
    """Return offset and nearness of each cell nearer than `REACH`."""
    side = range(-REACH, REACH + 1)
    values = (
        (row * columns + column, round(NEAR_PER_CELL * (REACH - hypot(row, column)))) for row in side for column in side
    )
    return tuple((offset, value) for offset, value in values if value > 0)


def _raise(near: bytearray, stamp: Sequence[tuple[int, int]], cell: int) -> None:
    for offset, value in stamp:
        if near[cell + offset] < value:
            near[cell + offset] = value


def _remake(grid: Grid, cell: int) -> None:
    """Recompute the clearance around a freed cell: reset it, and stamp the cells nearby that are still occupied."""
    if grid.occupied(cell):
        return
    for offset, _ in grid.stamp:
        grid.near[cell + offset] = 0
    row, column = divmod(cell, grid.columns)
    rows = range(max(REACH, row - 2 * REACH), min(grid.rows - REACH, row + 2 * REACH + 1))
    low, high = max(REACH, column - 2 * REACH), min(grid.columns - REACH, column + 2 * REACH + 1)
    for r in rows:
        line = grid.scores[r * grid.columns + low : r * grid.columns + high]
        if max(line) >= OCCUPIED:
            for n, score in enumerate(line):
                if score >= OCCUPIED:
                    _raise(grid.near, grid.stamp, r * grid.columns + low + n)
