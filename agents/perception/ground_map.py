"""Ground map of one robot: the floor features that can be crossed, and those that block the way.

Features that cannot be crossed are stored as points in `map`, so that a detour treats their edge like an obstacle's.
The features of a single profile are found in `ground_profile.py`.
"""

from __future__ import annotations

from math import ceil, cos, floor, inf, pi, sin
from typing import Literal

from msgspec.structs import replace

from lfa.agents.perception.ground_profile import GroundFeature, at, bridged_lines, is_ditch, readings_of, runs
from lfa.agents.perception.scan import Point
from lfa.protocol.geometry import Pose2D, in_base
from lfa.protocol.messages.robot import GroundProfile
from lfa.protocol.mission import Limits

BarKind = Literal["pothole", "bump", "ditch", "wall"]

CELL_M = 0.05
CELLS_MAX = 4000
MOVED_M = 0.3
"""Distance [m] the robot drives before the blocked points near it are looked up anew; a new blocked cell has the same
effect."""
NOWHERE = (inf, inf, 0.0)
JUDGE_M = 0.5
"""Distance [m] below which a feature without a visible end is treated as endless."""
SEEN_MIN = 4
AGAIN_S = 0.3
"""Maximum time [s] between two of the `SEEN_MIN` profiles that confirm a cell: single bad readings are no hole."""


class GroundMap:
    """Ground map of one robot: the features of the newest profile, and the floor that it must not drive on."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._cells: dict[tuple[int, int], int] = {}
        self._seen_at: dict[tuple[int, int], float] = {}
        self._crossable: dict[tuple[int, int], float] = {}
        """Near edges of crossable features, with the time when they were seen last."""
        self._near: list[Point] = []
        self._near_walls: list[Point] = []
        """Those of the blocked points near the robot that are no floor."""
        self._looked_at = NOWHERE
        """Position and range for which `_near` was looked up."""
        self._kinds: dict[tuple[int, int], tuple[BarKind, float]] = {}
        """Class and width [m] of the floor feature that blocks a cell."""
        self.ahead: GroundFeature | None = None
        """Nearest crossable feature ahead."""
        self._doubtful: list[Point] = []
        """Points in `map` where the newest profile shows a possible hole that is not confirmed."""
        self.looked = False
        """True once a profile was received."""

    def profile(self, profile: GroundProfile, pose_map: Pose2D, now: float) -> None:
        """Update with a profile that was made at `pose_map`."""
        features = [(line, feature) for line in range(len(profile.heights_m)) for feature in runs(profile, line)]
        ditch = is_ditch([feature for _, feature in features], len(profile.heights_m))
        self.ahead, self.looked, self._doubtful = None, True, []
        bridged = bridged_lines(features, self._limits)
        for line, found in features:
            feature = replace(found, kind="ditch") if ditch and found.kind == "pothole" else found
            if feature.width_m == inf and feature.size_m <= self._limits.climb_step_m:
                continue  # the floor that the robot came from is higher
            if not feature.crossable(self._limits) and feature.width_m > 1.5 * profile.increment_m:
                self._doubtful.append(at(pose_map, feature.near_m, profile.offsets_m[line]))
            if feature.width_m == inf and feature.near_m > JUDGE_M:
                continue  # its end will be seen from nearer by
            if not feature.crossable(self._limits):
                self._bar(profile, line, feature, pose_map, now)
            elif self._confirmed(profile.offsets_m[line], feature, pose_map, now):
                if line in bridged and feature.kind != "bump":
                    self._free(profile, line, feature, pose_map)
                if self.ahead is None or feature.near_m < self.ahead.near_m:
                    self.ahead = feature

    def bar_circle(self, x: float, y: float, radius_m: float, kind: BarKind, now: float) -> None:
        """Block the circle about (x, y) in `map` for this robot. A hole on it stays one: no floor is freed with it."""
        for cell in _around(x, y, radius_m):
            if self._cells.get(cell, 0) < SEEN_MIN or self._kinds[cell][0] == "wall":
                self._bar_cell(cell, kind, 2.0 * radius_m, SEEN_MIN, now)

    def free_circle(self, x: float, y: float, radius_m: float) -> None:
        """Take back what `bar_circle` has blocked as a wall."""
        for cell in _around(x, y, radius_m):
            if self._cells.get(cell) and self._kinds[cell][0] == "wall":
                self._cells[cell] = 0
        self._looked_at = NOWHERE

    def points(self, pose_map: Pose2D, within_m: float, *, walls: bool = True) -> list[Point]:
        """Return the blocked points nearer than `within_m`, in `base_link`; without `walls` those of the floor only."""
        barred = self._barred_near(pose_map, within_m)
        barred = barred + self._near_walls if walls and self._near_walls else barred
        if not barred:
            return []
        x, y, c, s, limit = pose_map.x, pose_map.y, cos(pose_map.theta), sin(pose_map.theta), within_m * within_m
        return [
            (c * dx + s * dy, c * dy - s * dx) for px, py in barred if (dx := px - x) * dx + (dy := py - y) * dy < limit
        ]

    def doubtful(self, pose_map: Pose2D) -> list[Point]:
        """Return unconfirmed edges of the newest profile that may block the way, in `base_link`.

        The robot brakes for them at once: if it waited for the next profiles, it could not stop before them.
        """
        return [in_base(pose_map, point) for point in self._doubtful]

    def nearest(self, x: float, y: float, within_m: float) -> tuple[BarKind, float] | None:
        """Return class and width [m] of the blocked floor nearest to (x, y) in `map`."""
        best, found = within_m * within_m, None
        for (i, j), seen in self._cells.items():
            apart = ((i + 0.5) * CELL_M - x) ** 2 + ((j + 0.5) * CELL_M - y) ** 2
            if seen >= SEEN_MIN and apart < best:
                best, found = apart, self._kinds[i, j]
        return found

    def _barred_near(self, pose_map: Pose2D, within_m: float) -> list[Point]:
        """Return the blocked floor nearer than `within_m` and some farther, found anew after a move."""
        x, y, reach_m = self._looked_at
        if reach_m != within_m or abs(pose_map.x - x) > MOVED_M or abs(pose_map.y - y) > MOVED_M:
            self._looked_at = x, y, _ = pose_map.x, pose_map.y, within_m
            far_m, self._near, self._near_walls = within_m + MOVED_M, [], []
            for (i, j), seen in self._cells.items():
                px, py = (i + 0.5) * CELL_M, (j + 0.5) * CELL_M
                if seen >= SEEN_MIN and abs(px - x) < far_m and abs(py - y) < far_m:
                    (self._near_walls if self._kinds[i, j][0] == "wall" else self._near).append((px, py))
        return self._near

    def _confirmed(self, y: float, feature: GroundFeature, pose_map: Pose2D, now: float) -> bool:
        """Return whether the near edge was also seen near here a moment ago."""
        i, j = _cell(at(pose_map, feature.near_m, y))
        around = [(i + di, j + dj) for di in (-1, 0, 1) for dj in (-1, 0, 1)]
        before = any(0.0 < now - self._crossable.get(cell, -inf) <= AGAIN_S for cell in around)
        if len(self._crossable) >= CELLS_MAX:
            self._crossable.clear()
        self._crossable[i, j] = now
        return before

    def _bar(self, profile: GroundProfile, line: int, feature: GroundFeature, pose_map: Pose2D, now: float) -> None:
        """Block the cells of the feature's readings on this line, counting each cell once per profile."""
        for cell in dict.fromkeys(map(_cell, readings_of(profile, line, feature, pose_map))):
            self._bar_cell(cell, feature.kind, feature.width_m, 1, now)

    def _free(self, profile: GroundProfile, line: int, feature: GroundFeature, pose_map: Pose2D) -> None:
        """Unblock a gap that the wheels bridge: seen at an angle it had seemed too wide."""
        for i, j in map(_cell, readings_of(profile, line, feature, pose_map)):
            for cell in [(i + di, j + dj) for di in (-1, 0, 1) for dj in (-1, 0, 1)]:
                if self._cells.get(cell) and self._kinds[cell][0] in ("pothole", "ditch"):
                    self._cells[cell] = 0
                    self._looked_at = NOWHERE

    def _bar_cell(self, cell: tuple[int, int], kind: BarKind, width_m: float, seen: int, now: float) -> None:
        if cell not in self._cells and len(self._cells) >= CELLS_MAX:
            return
        before = self._cells.get(cell, 0)
        if before < SEEN_MIN and now - self._seen_at.get(cell, -inf) > AGAIN_S:
            before = 0
        self._cells[cell], self._seen_at[cell], self._kinds[cell] = before + seen, now, (kind, width_m)
        self._looked_at = NOWHERE


def _around(x: float, y: float, radius_m: float) -> list[tuple[int, int]]:
    """Return the map cells on the circle about (x, y)."""
    count = ceil(2.0 * pi * radius_m / CELL_M)
    angles = [2.0 * pi * n / count for n in range(count)]
    return [_cell((x + radius_m * cos(angle), y + radius_m * sin(angle))) for angle in angles]


def _cell(point: Point) -> tuple[int, int]:
    """Return the map cell of a point in `map`."""
    return floor(point[0] / CELL_M), floor(point[1] / CELL_M)
