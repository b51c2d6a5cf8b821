"""Laser scan as points in `map`, and the free distance of a motion among them."""

from __future__ import annotations

from collections.abc import Sequence
from math import acos, atan2, cos, dist, hypot, inf, isnan, pi, sin, sqrt

from lfa.protocol.geometry import TAU, Pose2D, Twist, compose, distance, in_base, inverse
from lfa.protocol.messages.robot import LaserScan

SIGHT_M = 5.0
"""Range [m] beyond which points do not matter: what moves at 1.5 m/s needs three seconds from there."""
STRAIGHT_RADPS = 1e-3
READING_M_MIN = 0.05
"""Range [m] below which a reading is none, whatever `range_min_m` allows: some scanners report 0 for no echo. Half a
cell of the explorer's map, so that no reading marks the robot's own cell."""
HIDDEN_M = 0.05
"""Distance [m] beyond the scanner's minimum up to which a known point may be what a beam is too near to: from scan to
scan a robot moves so far."""
ROUNDED = 1.0 + 1e-9
"""Factor that covers the rounding error of a square."""

KEPT_M, KEPT_S, KEPT_CELL_M = 0.8, 30.0, 0.03
"""Distance [m] to the robot and time [s] up to which a point is kept on which no beam falls any more, and size [m] of
the cells of which each keeps one."""
JUMP_M = 0.3
"""Jump [m] of the pose from which what was seen before is taken along: less is as much as a robot drives from scan to
scan."""
COARSE_RAD, SPARSE_RAD, EDGE_M = 0.036, 0.21, 0.1
"""Angles [rad] between two beams above which what ends between them may stick out farther than the body's skin covers,
and above which nobody knows where it ends; and difference [m] of their ranges from which the nearer one shows an edge.
"""
ALL_ROUND_BEAMS = 2
"""Number of beams by which a scan may fall short of a whole turn and still has all of it in view."""
BLIND_RAD = 0.05
"""Angle [rad] beside a direction within which no beam looks, where the scanner does not."""

Point = tuple[float, float]


class Surroundings:
    """Points of the newest scan, kept in `map` so that they stay in place while the robot moves on."""

    def __init__(self, *, remembers: bool = False) -> None:
        """Create an empty one. What is close beside the robot is kept where its scanner does not look, if that has not
        the whole turn in view; with `remembers`, also where single beams say nothing.
        """
        self._remembers = remembers
        self._points_map: list[Point] = []
        self._edges_map: list[Point] = []
        """Points [m] in `map` half a beam beside the edges that the newest scan shows, with coarse beams only."""
        self._unseen: dict[tuple[int, int], tuple[Point, float]] = {}
        """Points [m] in `map` close to the robot that the newest scan cannot show, by their cell, with the time [s] at
        which they were seen."""
        self._newest: tuple[LaserScan, Pose2D] | None = None
        """Newest scan, and the pose in `map` at which it was made."""
        self.seen_at: float | None = None
        self.reach_m = SIGHT_M
        """Range [m] up to which that scan has points: the scanner's own, if it is less than `SIGHT_M`."""
        self.step_rad = 0.0
        """Angle [rad] between two of its beams."""

    def scan(
        self, scan: LaserScan, pose_map: Pose2D, now: float, mates: Sequence[Point] = (), mate_m: float = 0.0
    ) -> None:
        """Update with a scan made at `pose_map`. Out-of-range and bad readings give no points (REP-117). What was seen
        within `mate_m` of `mates` (in `map`) is not kept where the scanner does not look: they say where they are.
        """
        x, y, angle, step = pose_map.x, pose_map.y, pose_map.theta + scan.angle_min, scan.angle_increment
        low, high = max(scan.range_min_m, READING_M_MIN), min(SIGHT_M, scan.range_max_m)
        self.reach_m, self.step_rad = high, abs(step)
        if self._remembers or abs(step) * (len(scan.ranges_m) + ALL_ROUND_BEAMS) < TAU:
            self._remember(scan, pose_map, now, mates, mate_m)
        hidden = self._too_near(scan, pose_map) if -inf in scan.ranges_m else {}
        self._points_map = [
            (x + r * cos(angle + i * step), y + r * sin(angle + i * step)) if low < r else hidden[i]
            for i, r in enumerate(scan.ranges_m)
            if low < r < high or i in hidden
        ]
        self._edges_map = [
            (x + r * cos(angle + beam * step), y + r * sin(angle + beam * step))
            for beam, r in (
                _edges(scan.ranges_m, self.step_rad, low, high) if COARSE_RAD < self.step_rad < SPARSE_RAD else ()
            )
        ]
        self._newest, self.seen_at = (scan, pose_map), now

    def jump(self, pose_map: Pose2D) -> None:
        """Take all along with a robot that is at `pose_map` since `map` has moved under it by more than it drives from
        scan to scan.
        """
        if self._newest is None or distance(self._newest[1], pose_map) < JUMP_M:
            return
        by, unseen = compose(pose_map, inverse(self._newest[1])), self._unseen
        self._points_map, self._edges_map = _moved(self._points_map, by), _moved(self._edges_map, by)
        points = _moved([point for point, _ in unseen.values()], by)
        self._unseen = {cell: (point, at) for point, (cell, (_, at)) in zip(points, unseen.items(), strict=True)}

    def looks_at(self, place: Point) -> bool:
        """Return whether a beam of the newest scan looks in the direction of `place` in `map`, and past what is too
        near for it.
        """
        if self._newest is None:
            return False
        scan, pose_map = self._newest
        x, y = in_base(pose_map, place)
        [beam] = _beams(scan, atan2(y, x))
        return beam < len(scan.ranges_m) and scan.ranges_m[beam] > max(scan.range_min_m, READING_M_MIN)

    def _remember(self, scan: LaserScan, pose_map: Pose2D, now: float, mates: Sequence[Point], mate_m: float) -> None:
        """Keep the points of the last scan, and of those before, on which no beam of this one falls."""
        aside = int(BLIND_RAD / max(abs(scan.angle_increment), 1e-3))
        known = {
            (round(x / KEPT_CELL_M), round(y / KEPT_CELL_M)): ((x, y), now)
            for x, y in self._points_map + self._edges_map
        }
        self._unseen = {
            cell: (point, at)
            for cell, (point, at) in (self._unseen | known).items()
            if now - at < KEPT_S
            and all(dist(point, mate) > mate_m for mate in mates)
            and hypot(point[0] - pose_map.x, point[1] - pose_map.y) < KEPT_M
            and _is_blind(scan, aside, in_base(pose_map, point))
        }

    def _too_near(self, scan: LaserScan, pose_map: Pose2D) -> dict[int, Point]:
        """Return the nearest point known in each beam that has come too near to be measured (-inf): it is still there.

        Beams of which nothing is known are left out: a filter may hide the robot's own parts so.
        """
        hidden: dict[int, Point] = {}
        for point in sorted(self._points_map, key=lambda known: dist(known, (pose_map.x, pose_map.y)), reverse=True):
            away_x, away_y = point[0] - pose_map.x, point[1] - pose_map.y
            if hypot(away_x, away_y) <= scan.range_min_m + HIDDEN_M:
                [beam] = _beams(scan, atan2(away_y, away_x) - pose_map.theta)
                if beam < len(scan.ranges_m) and scan.ranges_m[beam] == -inf:
                    hidden[beam] = point
        return hidden

    @property
    def points_map(self) -> list[Point]:
        """Points of the newest scan in `map`, in beam order."""
        return self._points_map

    def points(self, pose_map: Pose2D, within_m: float = SIGHT_M) -> list[Point]:
        """Return the points nearer than `within_m`, in `base_link`."""
        x, y, c, s = pose_map.x, pose_map.y, cos(pose_map.theta), sin(pose_map.theta)
        limit = within_m * within_m
        return [
            (c * dx + s * dy, c * dy - s * dx)
            for px, py in (self._points_map + self._edges_map if self._edges_map else self._points_map)
            if (dx := px - x) * dx + (dy := py - y) * dy < limit
        ] + [in_base(pose_map, point) for point, _ in self._unseen.values()]


def _moved(points: Sequence[Point], by: Pose2D) -> list[Point]:
    return [
        (by.x + cos(by.theta) * x - sin(by.theta) * y, by.y + sin(by.theta) * x + cos(by.theta) * y) for x, y in points
    ]


def _edges(ranges_m: Sequence[float], step: float, low: float, high: float) -> list[tuple[float, float]]:
    """Return where edges lie at the mean, as the beam's number plus or minus a half, and the edge's range [m].

    A surface that ends between two beams `step` [rad] apart ends half a beam beside the one that hits it, more or less.
    One that goes on straight is no edge, however aslant the beams meet it: 1 / r of a line is A cos(angle - angle_0).
    """
    turn, edges, last = 2.0 * cos(step), list[tuple[float, float]](), len(ranges_m) - 1
    for i, r in enumerate(ranges_m):
        if not low < r < high:
            continue
        for aside in (-1, 1):
            before, after = (ranges_m[n] if 0 <= n <= last else inf for n in (i - aside, i + aside))
            inverse = turn / r - 1.0 / before if low < before < r + EDGE_M else 1.0 / r
            if inverse > 1.0 / high and not after < 1.0 / inverse + EDGE_M:
                edges.append((i + 0.5 * aside, r))
    return edges


def _is_blind(scan: LaserScan, aside: int, point: Point) -> bool:
    """Return whether no beam of a scan looks in the direction of `point` in `base_link`, or within `aside` beams."""
    beams = scan.ranges_m
    return all(n >= len(beams) or isnan(beams[n]) for n in _beams(scan, atan2(point[1], point[0]), aside))


def _beams(scan: LaserScan, bearing: float, aside: int = 0) -> list[int]:
    """Return the numbers of the beam in direction `bearing` [rad] in `base_link` and of `aside` more on either side,
    whether the scanner turns left or right; above those of the scan where it does not look.
    """
    step = scan.angle_increment or TAU
    turned = bearing - scan.angle_min if step > 0.0 else scan.angle_min - bearing
    around = max(1, round(TAU / abs(step)))
    place = round(turned % TAU / abs(step))
    return [n % around for n in range(place - aside, place + aside + 1)]


def is_covered(scan: LaserScan, bearing: float, within_m: float) -> bool:
    """Return whether the beams on both sides of `bearing` [rad] in `base_link` end within `within_m` [m]: no end of
    what they meet lies between them.
    """
    step = scan.angle_increment or TAU
    turned = bearing - scan.angle_min if step > 0.0 else scan.angle_min - bearing
    around = max(1, round(TAU / abs(step)))
    beam, beams = int(turned % TAU / abs(step)), scan.ranges_m
    low = max(scan.range_min_m, READING_M_MIN)
    beside = (beam % around, (beam + 1) % around)
    return all(n < len(beams) and low < beams[n] <= within_m for n in beside)


def without(points: Sequence[Point], center: Point, radius_m: float) -> list[Point]:
    """Return `points` without those within `radius_m` of `center`, where a team-mate is known to stand."""
    x, y, limit = center[0], center[1], radius_m * radius_m
    return [p for p in points if (dx := p[0] - x) * dx + (dy := p[1] - y) * dy > limit]


def free_along(points: Sequence[Point], twist: Twist, half_width_m: float, within_m: float = inf) -> float:
    """Return the distance [m] that a robot of `half_width_m` can drive along the arc of `twist` before it meets a
    point.

    Return `within_m` if it meets none before. Points already within the half width count only when the motion leads
    towards them.
    """
    v, omega = twist.linear_x, twist.angular_z
    if v == 0.0:
        return within_m
    sign = 1.0 if v > 0.0 else -1.0
    if abs(omega) <= STRAIGHT_RADPS * abs(v):
        ahead = [_straight(sign * x, y, half_width_m) for x, y in points if -half_width_m < y < half_width_m]
        return min(min(ahead, default=inf), within_m)
    radius = abs(v / omega)
    left = 1.0 if omega * sign > 0.0 else -1.0
    center_y, inner_m, outer_m = left * radius, radius - half_width_m, radius + half_width_m
    free_m, far, near = within_m, outer_m * outer_m * ROUNDED, inner_m * abs(inner_m) / ROUNDED
    sooner = (free_m + half_width_m) ** 2 * ROUNDED
    for x, y in points:  # most points are off the bend, or farther than its free part: they are skipped without a call
        beside, square = y - center_y, x * x
        if near < square + beside * beside < far and square + y * y < sooner:
            from_center = hypot(x, beside)
            if inner_m < from_center < outer_m and from_center > 0.0:
                met_m = _bent(sign * x, left * y, from_center, radius, half_width_m)
                if met_m < free_m:
                    free_m, sooner = met_m, (met_m + half_width_m) ** 2 * ROUNDED
    return free_m


def _straight(x: float, y: float, half_width_m: float) -> float:
    """Return the distance along the x axis until the body meets a point less than `half_width_m` off it."""
    if x <= 0.0:
        return inf
    return max(0.0, x - sqrt(half_width_m * half_width_m - y * y))


def _bent(x: float, y: float, from_center: float, radius: float, half_width_m: float) -> float:
    """Return the distance on a left bend about (0, radius), driven forwards, until the body meets the point, which is
    on the bend and `from_center` away from that centre.
    """
    if hypot(x, y) < half_width_m:
        return inf if x <= 0.0 else 0.0
    # The body touches the point while the angle between them, seen from the bend's centre, is at most `touching`.
    reach = (radius * radius + from_center * from_center - half_width_m * half_width_m) / (2.0 * radius * from_center)
    touching = acos(max(-1.0, min(1.0, reach)))
    return radius * ((atan2(x, radius - y) - touching) % (2.0 * pi))
