"""Body of a robot that is a convex polygon, and its free way among the points of a scan.

In a passage narrower than its circle the polygon is moved along the arc: what it sweeps decides, its rear corners
included. So it does for a turn on the spot, which a round body can always make.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from math import atan2, cos, floor, hypot, inf, pi, sin

from lfa.agents.perception.scan import ROUNDED, STRAIGHT_RADPS, Point
from lfa.agents.perception.swept import Near, Side, Swept
from lfa.protocol.geometry import TAU, Twist, convex
from lfa.protocol.mission import Mission

NEARING = 0.02
"""Share of its way by which a point inside the margin may come nearer to the side that it is beside: a wall along which
the robot drives does not stop it."""
SECTORS = 64
SECTOR_RAD = TAU / SECTORS
FAR_M = 1.0
"""Number of directions in which the sides are sorted, and a margin [m] beyond all."""
NEARER_MM = 2.0
"""Length [mm] by which less is kept than the nearest point inside the margin leaves: other readings err, too."""
ERROR_M = 0.02
"""Depth [m] inside the body up to which a reading errs as those of a wall beside it do. A deeper one is of no wall, and
says nothing of how far the others err: a part of the robot itself, dust before the scanner."""
CORNER = 1.5
"""Length of a right corner of the margin in margins, and more."""
Inside = tuple[float, float, float, float, float]
"""Distance [m] of a point to the side that it is beside, below 0 in the body, that side's outward normal x, y, and the
point itself."""


class PolygonBody:
    """Polygon of one robot's body in `base_link`, with corners counter-clockwise around the origin."""

    def __init__(self, corners_m: Sequence[Point]) -> None:
        self._sides = tuple(_side(corners_m[n - 1], corner) for n, corner in enumerate(corners_m))
        self._core_m = -0.5 * min(far_m for _, _, far_m in self._sides)
        """Margin [m], negative, of what is surely body: an error of a reading does not reach it."""
        self.reach_m = max(hypot(x, y) for x, y in corners_m)
        """Radius [m] of the circle that it turns in."""
        self._facing = [self._facing_in(n) for n in range(SECTORS + 1)]
        """Sides of which one is the nearest to a point in each sector, outside of the core."""
        self._grown = cache(self._grow)  # bounded by the number of margins in the program

    @classmethod
    def of(cls, mission: Mission) -> PolygonBody | None:
        """Return the polygon of the mission's robots; None for round ones, and for what is no polygon of a body."""
        corners = mission.footprint_m or ()
        if not convex(corners) or any(_side(corners[n - 1], corner)[2] <= 0.0 for n, corner in enumerate(corners)):
            return None
        return cls(corners)

    def inside(self, points: Sequence[Point], margin_m: float) -> list[Inside]:
        """Return the points that are nearer to the body than `margin_m`, which each way among them asks for."""
        square, found = self._reach(margin_m), list[Inside]()
        core = self._core_m * self._core_m
        nx, ny, far_m = self._sides[0]
        for x, y in points:
            # Where the last point was beyond a side, the next one mostly is.
            if x * x + y * y < square and nx * x + ny * y - far_m < margin_m:
                sides = self._facing[int((atan2(y, x) + pi) / SECTOR_RAD)] if x * x + y * y > core else self._sides
                apart_m, nx, ny, far_m = max([(nx * x + ny * y - far_m, nx, ny, far_m) for nx, ny, far_m in sides])
                if apart_m < margin_m:
                    found.append((apart_m, nx, ny, x, y))
        return found

    def nearer(self, inside: Sequence[Inside], margin_m: float) -> list[Inside]:
        """Return those of `inside` that are nearer to the body than `margin_m`, a smaller one than theirs."""
        square = self._reach(margin_m)
        return [one for one in inside if one[0] < margin_m and one[3] * one[3] + one[4] * one[4] < square]

    def _reach(self, margin_m: float) -> float:
        """Return the square of a distance [m^2] beyond which no point counts as inside the margin."""
        return min(self.reach_m + CORNER * margin_m, self._grown(margin_m).reach_m * ROUNDED) ** 2

    def grown_m(self, margin_m: float) -> float:
        """Return the distance [m] of the farthest corner of the body with a margin around it."""
        return self._grown(margin_m).reach_m * ROUNDED

    def beside(self, near: Sequence[Near], curvature: float, margin_m: float) -> list[Point]:
        """Return the points that may come nearer to the body than `margin_m` on an arc of this curvature [1/m]."""
        return self._grown(margin_m).beside(near, curvature)

    def free_along(
        self,
        points: Sequence[Point],
        twist: Twist,
        margin_m: float,
        within_m: float = inf,
        inside: Sequence[Inside] | None = None,
    ) -> float:
        """Return the distance [m] that the body can drive along the arc of `twist` before it comes within `margin_m` of
        a point; `within_m` if it meets none before. `inside`: those of the points that `inside` returns, where they are
        known; the nearest points are best first.

        What is inside the margin already ends the way only if it comes nearer; else less than the margin is kept.
        """
        v, omega = twist.linear_x, twist.angular_z
        if v == 0.0:
            return within_m
        met = self._met(points, twist, margin_m, inside)
        if met is None:
            return 0.0
        if abs(omega) > STRAIGHT_RADPS * abs(v):
            center_y = v / omega
            radius_m = abs(center_y)
            free_rad = within_rad = within_m / radius_m
            for swept, those in met:
                free_rad = swept.turn(those, center_y, omega, free_rad)
            return within_m if free_rad == within_rad else radius_m * free_rad
        sign, free_m = (1.0 if v > 0.0 else -1.0), within_m
        for swept, those in met:
            free_m = swept.straight(those, sign, free_m)
        return max(0.0, free_m)

    def free_turn(
        self,
        points: Sequence[Point],
        radps: float,
        margin_m: float,
        within_rad: float = inf,
        inside: Sequence[Inside] | None = None,
    ) -> float:
        """Return the angle [rad] of a turn on the spot towards the sign of `radps`, until a point is met as there."""
        met = self._met(points, Twist(0.0, radps), margin_m, inside)
        if met is None:
            return 0.0
        free_rad = within_rad
        for swept, those in met:
            free_rad = swept.turn(those, 0.0, radps, free_rad)
        return free_rad

    def _met(
        self, points: Sequence[Point], twist: Twist, margin_m: float, inside: Sequence[Inside] | None
    ) -> list[tuple[Swept, Sequence[Point]]] | None:
        """Return the body with the margin that a motion can keep, and the points that it must not meet: `margin_m`, or
        a little less than the nearest point leaves; None where `twist` brings a point inside the margin nearer to the
        side that it is beside. Points deeper in the body than `ERROR_M` must only not come into its core.
        """
        v, omega = twist.linear_x, twist.angular_z
        nearest_m, deep = margin_m, list[Point]()
        for apart_m, nx, ny, x, y in self.inside(points, margin_m) if inside is None else inside:
            moves_x, moves_y = omega * y - v, -omega * x
            if nx * moves_x + ny * moves_y < -NEARING * hypot(moves_x, moves_y):
                return None
            if apart_m < -ERROR_M:
                deep.append((x, y))
            else:
                nearest_m = min(nearest_m, apart_m)
        kept_m = margin_m
        if nearest_m < margin_m:  # in whole millimetres, so that few polygons are kept
            kept_m = max(floor(1000.0 * nearest_m - NEARER_MM) / 1000.0, self._core_m)
        if not deep:
            return [(self._grown(kept_m), points)]
        others = [point for point in points if point not in deep]
        return [(self._grown(kept_m), others), (self._grown(self._core_m), deep)]

    def _facing_in(self, sector: int) -> tuple[Side, ...]:
        """Return the sides of which a point in a sector is farthest beyond one: where it is farther beyond another side
        at all corners of the sector, it is so in all of it.
        """
        corners = [
            (far_m * cos(angle), far_m * sin(angle))
            for angle in ((sector + n) * SECTOR_RAD - pi for n in (0, 1))
            for far_m in (-self._core_m, 2.0 * self.reach_m + FAR_M)
        ]
        beyond = {side: [side[0] * x + side[1] * y - side[2] for x, y in corners] for side in self._sides}
        least = max(beyond.values(), key=sum)
        return tuple(
            side for side, those in beyond.items() if any(a >= b - 1e-9 for a, b in zip(those, least, strict=True))
        )

    def _grow(self, margin_m: float) -> Swept:
        """Return the polygon with a margin around it, its corners kept sharp."""
        return Swept([(nx, ny, far_m + margin_m) for nx, ny, far_m in self._sides])


def _side(a: Point, b: Point) -> Side:
    length_m = hypot(b[0] - a[0], b[1] - a[1])
    nx, ny = (b[1] - a[1]) / length_m, (a[0] - b[0]) / length_m
    return nx, ny, nx * a[0] + ny * a[1]
