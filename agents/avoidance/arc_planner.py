"""Local planner: the arc that follows a planned route among the points of the newest scan, and past what moves.

A planner on a grid knows the ground to within a cell; a gap that is a few centimetres wider than the body needs the
scan itself. Where the wanted arc is not free with room to spare, arcs of other curvatures are compared, as in the
dynamic window approach (Fox, Burgard, Thrun 1997), by their distance to the route, the clearance beside them and the
way that they leave free.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import atan2, cos, hypot, inf, pi, sin, sqrt

from lfa.agents.avoidance.safety import BRAKING_SHARE, turn_on_spot
from lfa.agents.perception.footprint import Inside, PolygonBody
from lfa.agents.perception.scan import STRAIGHT_RADPS, Point, free_along
from lfa.agents.perception.swept import Near
from lfa.protocol.geometry import Pose2D, Twist, in_base, wrap
from lfa.protocol.mission import Limits

SKIN_M = 0.025
"""Clearance [m] beside the body that an arc keeps: a little more than the safety function brakes for."""
ROOM_M = 0.12
"""Clearance [m] with which the wanted arc is taken without a comparison; less costs."""
LOOK_M = 0.9
"""Length [m] of the arcs that are compared."""
LEAST_M = 0.06
"""Length [m] below which an arc is none."""
CURVATURES_PER_M = (0.0, 0.35, 0.8, 1.4, 2.2, 3.4, 5.5, 9.0)
FINE_PER_M = (0.07, 0.17)
"""Curvatures that a polygon compares besides: between walls hardly wider than itself it turns by degrees."""
HEADING_M = 0.25
"""Distance to the route [m] that an error of heading of 1 rad at the end of an arc counts as."""
SHORT, CLOSE, CHANGE_M = 0.9, 0.35, 0.05
"""Cost of each metre that an arc is short of `LOOK_M`, of each metre without `ROOM_M`, and of another curvature than
the last one's."""
ALIGNED_RAD, SQUARE_RAD = 0.15, 0.04
"""Angle [rad] to the route below which a round body and a polygon face along it: the latter passes a gap hardly wider
than itself only squarely."""
TURNS_RAD = 0.03
"""Angle [rad] by which a polygon must be able to turn on the spot, else it backs off to where it can."""
BACK_MPS = 0.15
BACK_FREE_M = 0.06
ROUNDING_M = 1e-6
"""Distance [m] that covers rounding errors where points beside an arc are chosen."""


class ArcPlanner:
    """Local planner of one robot that leads along a planned route."""

    def __init__(self, radius_m: float, limits: Limits, footprint: PolygonBody | None = None) -> None:
        """Create a planner; `footprint` is None for a round body."""
        self._radius_m = radius_m
        self._limits = limits
        self._footprint = footprint
        bent = CURVATURES_PER_M[1:] if footprint is None else (*FINE_PER_M, *CURVATURES_PER_M[1:])
        self._curvatures = (0.0, *bent, *(-c for c in bent))
        self._curvature: float | None = None
        self.blocked = False
        """True while no arc leads on although the robot faces along its route."""
        self._turns_away = False
        """True from where neither an arc nor the way back is free, beside what the body touches, until it is off that.
        """

    def steer(
        self,
        points: Sequence[Point],
        route: Callable[[float], Point],
        wanted: Twist,
        turn_radps: float,
        bend_mps: Callable[[float], float] = lambda _curvature: 0.0,
    ) -> Twist:
        """Return `wanted` or the twist of a better arc. `points` are in `base_link`, and so is `route(s)`, the point
        `s` [m] ahead on the route; `turn_radps` is the largest rate of a turn on the spot, and `bend_mps(curvature)`
        the speed [m/s] that an arc of this curvature [1/m] may have, where that is more than the wanted one's.
        """
        self.blocked = False
        if wanted.linear_x <= 0.0:
            return self._turned(points, wanted)
        look_m = min(LOOK_M, max(hypot(*route(LOOK_M)), LEAST_M))
        inside = None if self._footprint is None else _Inside(self._footprint, points)
        if self._free_along(points, wanted, ROOM_M, look_m, None if inside is None else inside.room) >= look_m:
            self._curvature = None
            return wanted
        reach_m = look_m + self._radius_m + ROOM_M
        near = sorted([(far, x, y) for x, y in points if (far := x * x + y * y) < reach_m * reach_m])
        best = self._best(near, inside, route, wanted, look_m)
        nearest = [(x, y) for _, x, y in near]
        self._turns_away = self._turns_away and self._touches(nearest)
        if best is None:
            return self._turn(nearest, route, turn_radps)
        self._curvature, roomy_m = best
        v = min(max(wanted.linear_x, bend_mps(self._curvature)), self._close_mps(roomy_m))
        omega_max = self._limits.omega_max_radps
        v = min(v, omega_max / max(abs(self._curvature), 1e-9))
        return Twist(v, v * self._curvature)

    def _best(
        self,
        near: Sequence[Near],
        inside: _Inside | None,
        route: Callable[[float], Point],
        wanted: Twist,
        look_m: float,
    ) -> tuple[float, float] | None:
        """Return the curvature [1/m] of the best arc, and its length [m] before something is nearer beside it than
        `ROOM_M`, which is inf where nothing is; None without an arc.
        """
        width_m = self._radius_m + ROOM_M
        reach_m = width_m if self._footprint is None else self._footprint.grown_m(ROOM_M)
        held = 0.0 if self._footprint is None else reach_m * reach_m
        ahead = [point for point in near if point[1] > 0.0 or point[0] < held]
        least, best = inf, None
        own = wanted.angular_z / wanted.linear_x
        for curvature in (own, *self._curvatures):
            arc = Twist(1.0, curvature)
            those = ahead if _leads_away(curvature, look_m, reach_m) else near
            skin = room = None
            if self._footprint is None or inside is None:
                points = _beside(those, curvature, width_m)
            else:
                points = self._footprint.beside(those, curvature, ROOM_M)
                skin, room = inside.beside(curvature, width_m)
            free_m = self._free_along(points, arc, SKIN_M, look_m, skin)
            if free_m < LEAST_M:
                continue
            cost = _off(route, curvature, free_m) + SHORT * (look_m - free_m)
            if self._curvature is not None and curvature != self._curvature:
                cost += CHANGE_M
            if cost >= least:
                continue
            roomy_m = self._free_along(points, arc, ROOM_M, free_m, room)
            cost += CLOSE * (free_m - roomy_m)
            if cost < least:
                least, best = cost, (curvature, roomy_m if roomy_m < free_m else inf)
        return best

    def _close_mps(self, roomy_m: float) -> float:
        """Return the speed [m/s] from which the drive slows down, over `roomy_m` [m], to one from which it stops within
        `ROOM_M`.
        """
        return sqrt(2.0 * BRAKING_SHARE * self._limits.a_max_mps2 * (roomy_m + ROOM_M))

    def _turn(self, points: Sequence[Point], route: Callable[[float], Point], turn_radps: float) -> Twist:
        """Return a turn on the spot towards the route, which a round body can always make; back off when it faces
        along the route already, or turn away from the nearest of `points`, where that is barred, too.
        """
        away = self._away(points) if self._turns_away else None
        if away is None:
            self._turns_away = False
            x, y = route(self._radius_m + ROOM_M)
            bearing = atan2(y, x)
            if abs(bearing) > (ALIGNED_RAD if self._footprint is None else SQUARE_RAD):
                return self._turned(points, turn_on_spot(bearing, turn_radps, self._limits))
            self.blocked, backs = True, self.back(points)
            away = None if backs.linear_x < 0.0 else self._away(points)
            if away is None:
                return backs
            self._turns_away = True
        self.blocked = False
        return turn_on_spot(away, turn_radps, self._limits)

    def _away(self, nearest: Sequence[Point]) -> float | None:
        """Return the bearing [rad] away from the first of `nearest`, if it touches a round body that can drive off."""
        if self._footprint is not None or not self._touches(nearest):
            return None
        x, y = nearest[0]
        away = Pose2D(0.0, 0.0, atan2(-y, -x))
        ahead = [in_base(away, point) for point in nearest]
        return away.theta if free_along(ahead, Twist(1.0, 0.0), self._radius_m + SKIN_M) >= LEAST_M else None

    def _touches(self, nearest: Sequence[Point]) -> bool:
        """Return whether the first of `nearest` is nearer to a round body than an arc may lead it."""
        return bool(nearest) and hypot(*nearest[0]) < self._radius_m + SKIN_M

    def _turned(self, points: Sequence[Point], wanted: Twist) -> Twist:
        """Return `wanted`, which turns on the spot or backs; back off where the body cannot turn so far."""
        if self._footprint is None or wanted.linear_x < 0.0 or wanted.angular_z == 0.0:
            return wanted
        free_rad = self._footprint.free_turn(points, wanted.angular_z, SKIN_M, TURNS_RAD)
        if free_rad >= TURNS_RAD:
            return wanted
        self.blocked = True
        return self.back(points)

    def back(self, points: Sequence[Point]) -> Twist:
        """Return the twist that backs off; still where that is barred."""
        free_m = self._free_along(points, Twist(-1.0, 0.0), SKIN_M)
        return Twist(-BACK_MPS if free_m > BACK_FREE_M else 0.0, 0.0)

    def _free_along(
        self,
        points: Sequence[Point],
        twist: Twist,
        margin_m: float,
        within_m: float = inf,
        inside: Sequence[Inside] | None = None,
    ) -> float:
        if self._footprint is not None:
            return self._footprint.free_along(points, twist, margin_m, within_m, inside)
        return free_along(points, twist, self._radius_m + margin_m, within_m)


class _Inside:
    """Points inside the margins of a polygon, found once for all arcs of a step."""

    def __init__(self, footprint: PolygonBody, points: Sequence[Point]) -> None:
        self.room = footprint.inside(points, ROOM_M)
        self._room = {(x, y): one for one in self.room for *_, x, y in (one,)}
        self._skin = {(x, y): one for one in footprint.nearer(self.room, SKIN_M) for *_, x, y in (one,)}
        self._near = [(x * x + y * y, x, y) for x, y in self._room]

    def beside(self, curvature: float, width_m: float) -> tuple[list[Inside], list[Inside]]:
        """Return those inside `SKIN_M` and those inside `ROOM_M` that an arc may come nearer to than `width_m` [m]."""
        points = _beside(self._near, curvature, width_m) if self._near else ()
        return [self._skin[point] for point in points if point in self._skin], [self._room[point] for point in points]


def _leads_away(curvature: float, look_m: float, width_m: float) -> bool:
    """Return whether an arc of `look_m` [m] meets nothing that lies behind the robot: it does not come round."""
    return abs(curvature) * look_m < pi / 2 and abs(curvature) * width_m < 1.0


def _beside(near: Sequence[Near], curvature: float, width_m: float) -> list[Point]:
    """Return the points that may be nearer than `width_m` [m] beside an arc: few are, and each arc asks twice."""
    width_m += ROUNDING_M
    if abs(curvature) <= STRAIGHT_RADPS:
        return [(x, y) for _, x, y in near if -width_m < y < width_m]
    center_y = 1.0 / curvature
    inner_m, outer_m, twice = abs(center_y) - width_m, abs(center_y) + width_m, 2.0 * center_y
    low, high = inner_m * abs(inner_m) - center_y * center_y, outer_m * outer_m - center_y * center_y
    return [(x, y) for far, x, y in near if low < far - twice * y < high]


def _off(route: Callable[[float], Point], curvature: float, length_m: float) -> float:
    """Return how far [m] the end of an arc of `length_m` is off the route, an error of heading included."""
    turn = curvature * length_m
    if abs(turn) < 1e-6:
        x, y = length_m, 0.0
    else:
        x, y = sin(turn) / curvature, (1.0 - cos(turn)) / curvature
    (rx, ry), (nx, ny) = route(length_m), route(length_m + 0.2)
    ahead = atan2(ny - ry, nx - rx) if hypot(nx - rx, ny - ry) > 1e-3 else turn
    return hypot(x - rx, y - ry) + HEADING_M * min(abs(wrap(ahead - turn)), pi)
