"""Obstacle tracker: assigns scan points to stationary obstacles, walls, and moving obstacles with their velocity."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import hypot, inf, sqrt
from typing import Literal

from msgspec import Struct

from lfa.agents.perception.moving_surface import SurfaceWatch
from lfa.agents.perception.scan import SIGHT_M, Point
from lfa.agents.perception.scan_view import ScanView

Kind = Literal["stationary", "moving", "wall"]

GAP_M = 0.3
"""Distance [m] between points of neighbouring beams above which they belong to two obstacles."""
WALL_M = 1.0
"""Width [m] above which an obstacle is a wall."""
FLAT_WALL_M = 0.45
FLAT_SHARE = 0.1
"""Depth as a share of the width: an obstacle wider than `FLAT_WALL_M` and flatter than this is a wall too."""
SMALL_M = 0.08
"""Radius [m] below which only a part of an obstacle is visible."""
NEXT_M, NEXT_MPS, NEXT_M_MAX = 0.15, 1.0, 0.5
"""Association gate [m] around a track's predicted position: a measurement error, plus a speed [m/s] for its motion, up
to a maximum."""
FORGET_S, HIDDEN_S = 1.0, 3.0
"""Times [s] after which an unseen track is deleted; longer for a moving one, which may reappear from behind another
obstacle."""
ALPHA, BETA = 0.5, 0.25
MOVING_MPS = 0.12
ANCHOR_S = 1.0
"""Minimum time [s] over which the mean speed must reach `MOVING_MPS`, as the present one must, for a moving
obstacle."""
QUICK_S, QUICK_M, QUICK_MPS = 0.3, 0.3, 0.5
"""The same for what comes fast: the minimum time [s], way [m] and mean speed [m/s] of all of it. After `ANCHOR_S` it
would be there."""
SLOW_MPS, SLOW_M, SLOW_S, ANCHORS_MAX = 0.02, 0.1, 3.0, 7
"""Mean speed [m/s] of the slowest motion that is told, the way [m] that it must have come, more than errors explain,
the minimum time [s] of that, and the number of anchors that are kept for it."""
SLOW_RADII = 0.6
"""Way that a slow motion must have come, in radii of the obstacle: as a robot drives round it, another part is seen."""
TURNS_S = 2.0
"""Time [s] after its last motion for which what has moved counts as moving: it turns round, or makes a short stop."""
KNOWN_S = 8.0
"""Time [s] after its last motion for which the centre of what has moved is enough to tell that it moves again."""
STEADY_SHARE = 0.25
"""Least speed between two anchors, as a share of the mean: a pose that is corrected is no motion."""
EDGE_M = 0.1
"""Distance [m] to the sensor's range limit within which an obstacle counts as partly visible: its centre would seem to
move."""
TOUCH_M = 0.35
HIDDEN_RAD = 0.09
"""Angle [rad] within which a nearer obstacle may hide an end; neighbouring beams of a scan of 180 are less than half of
this apart."""
TRACKS_MAX = 64
KEEPS_S = 1.0
"""Time [s] for which what turns again and again is expected to go on as it does; where it goes then is not known."""
STEPS_MIN = 4
"""Number of steps, each about a second long, that are needed to tell: one turn is none of many."""
TURNING_SHARE, STRAIGHT_SHARE = 0.35, 0.15
"""Change of velocity from step to step, as a share of the sum of both speeds, above which it turns again and again, and
below which one that did keeps its course: 0 for what goes straight on, about 0.6 for what takes any direction in each
step, 1 for what goes to and fro."""
LEAST_MPS = 0.1
"""Mean speed [m/s] below which errors of the measured places are more than turns."""
PROOFS_MIN = 2
"""Number of ends, of the two now and the two before, that must be in places seen free: one may be a grazing beam."""


class Feature(Struct, frozen=True, gc=False):
    """Obstacle in `map`: centre [m], radius of the enclosing circle [m], velocity [m/s]."""

    kind: Kind
    x: float
    y: float
    radius_m: float
    vx: float = 0.0
    vy: float = 0.0
    whole: bool = True
    """True when both ends are in sight, so that the width is known."""
    keeps_s: float = inf
    """Time [s] from now for which it keeps its velocity; then it is somewhere about."""

    def at(self, later_s: float) -> Point:
        """Return the position `later_s` [s] from now."""
        later_s = min(later_s, self.keeps_s)
        return self.x + self.vx * later_s, self.y + self.vy * later_s


class _Track(Struct):
    x: float
    y: float
    radius_m: float
    seen_at: float
    ends: tuple[Point, Point]
    """First and last point."""
    anchors: list[tuple[float, tuple[Point, ...], ScanView]]
    """Time, centre and ends at intervals, and the scan that showed them, the newest last."""
    vx: float = 0.0
    vy: float = 0.0
    moves: bool = False
    moved_at: float = -inf
    """Time [s] at which it was last seen to move."""
    slow: Point | None = None
    """Mean velocity [m/s] of a motion that is too slow for the filter; None for another."""
    restless: bool = False
    """True for what turns again and again."""

    joined_wall: bool = False
    """True when the scan before its first one showed a wall in its place."""

    def places(self) -> tuple[Point, ...]:
        return ((self.x, self.y), *self.ends)

    def off_wall(self, now: float) -> bool:
        """Return whether it has just come off a wall in the scan, as a door does: its own motion is not told yet."""
        return self.joined_wall and not self.moves and now - self.anchors[0][0] < ANCHOR_S

    def has_moved(self, view: ScanView) -> bool:
        """Return whether all of it has moved, as `view` shows it now; an end stays when it comes out from behind an
        obstacle or seems to join one.

        A moving obstacle that passes another one can lose an end to it as well: for one that has moved of late the
        centre is enough.
        """
        at, before, seen = self.anchors[-2] if len(self.anchors) > 1 else self.anchors[0]
        lasted = self.seen_at - at
        far = [hypot(x - bx, y - by) for (x, y), (bx, by) in zip(self.places(), before, strict=True)]
        if lasted < ANCHOR_S and min(far) > max(QUICK_M, QUICK_MPS * lasted) and lasted >= QUICK_S:
            return self._has_left(before, seen, view)
        known = self.seen_at - self.moved_at <= KNOWN_S
        far_m = far[0] if known else min(far)
        if lasted < ANCHOR_S or far_m <= MOVING_MPS * lasted or hypot(self.vx, self.vy) <= MOVING_MPS:
            return False
        return known or self._has_left(before, seen, view)

    def _has_left(self, before: tuple[Point, ...], seen: ScanView, view: ScanView) -> bool:
        """Return whether two ends prove that it has left `before`, of what `seen` showed then and `view` shows now.

        What stands seems to move as well when a robot that passes by sees other parts of it. But only what moves has
        ends where a scan looked through before, or had them where one looks through now.
        """
        return sum(map(seen.shows_free, self.ends)) + sum(map(view.shows_free, before[1:])) >= PROOFS_MIN

    def slow_velocity(self, view: ScanView) -> Point | None:
        """Return the mean velocity of all of it over the anchors, when it creeps in one direction; None otherwise.
        `view` is the newest scan.
        """
        at, before, seen = self.anchors[0]
        lasted = self.seen_at - at
        if lasted < SLOW_S:
            return None
        far = [hypot(x - bx, y - by) for (x, y), (bx, by) in zip(self.places(), before, strict=True)]
        if min(far) < max(SLOW_M, SLOW_MPS * lasted, SLOW_RADII * self.radius_m):
            return None
        vx, vy = (self.x - before[0][0]) / lasted, (self.y - before[0][1]) / lasted
        least = STEADY_SHARE * (vx * vx + vy * vy)
        for (at, (a, *_), _), (until, (b, *_), _) in pairwise(self.anchors):
            if (b[0] - a[0]) * vx + (b[1] - a[1]) * vy < least * (until - at):
                return None
        return (vx, vy) if self.moves or self._has_left(before, seen, view) else None


class Tracker:
    """Features of the newest scan, and the tracks of obstacles that may move."""

    def __init__(self) -> None:
        self._tracks: list[_Track] = []
        self._seen: list[tuple[list[Point], Feature | _Track]] = []
        """Obstacles of the newest scan with their points."""
        self._surfaces = SurfaceWatch()
        self._view: ScanView | None = None
        """The newest scan."""
        self._seen_at = 0.0

    def update(
        self,
        points_map: Sequence[Point],
        eye: Point,
        mates: Sequence[Point],
        mate_m: float,
        now: float,
        reach_m: float = SIGHT_M,
        step_rad: float = 0.0,
    ) -> None:
        """Update with one scan's points in beam order, seen from `eye` up to `reach_m` [m], `step_rad` [rad] between
        two beams; points within `mate_m` of a team-mate are left out.
        """
        walls = [points for points, thing in self._seen if isinstance(thing, Feature) and thing.kind == "wall"]
        self._seen, self._seen_at = [], now
        self._tracks = [t for t in self._tracks if now - t.seen_at <= (HIDDEN_S if t.moves else FORGET_S)]
        clusters, view = _clusters(points_map), ScanView(eye, points_map, reach_m, step_rad)
        self._view = view
        for n, cluster in enumerate(clusters):
            x, y, radius_m = _circle(cluster, eye)
            ends = (cluster[0], clusters[n - 1][-1]), (cluster[-1], clusters[(n + 1) % len(clusters)][0])
            whole = len(clusters) == 1 or not any(_hidden(end, beside, eye) for end, beside in ends)
            if _extent(cluster) > (FLAT_WALL_M if _flat(cluster) else WALL_M):
                self._seen.append((cluster, Feature("wall", x, y, radius_m, whole=whole)))
            elif _at_the_edge(cluster, eye, reach_m) or any(
                hypot(x - mx, y - my) < mate_m or _touches(cluster, mx, my) for mx, my in mates
            ):
                continue
            elif not whole or radius_m < SMALL_M or _flat(cluster):
                # An obstacle partly behind another one, and a wall seen end on, would seem to move.
                self._seen.append((cluster, Feature("stationary", x, y, radius_m, whole=whole)))
            else:
                track = self._follow((x, y, radius_m), (cluster[0], cluster[-1]), view, now)
                if track is not None:
                    if len(track.anchors) == 1 and track.anchors[0][0] == now:
                        track.joined_wall = any(_touches(wall, *end) for wall in walls for end in track.ends)
                    self._seen.append((cluster, track))
        untold = [points for points, thing in self._seen if isinstance(thing, Feature) or thing.off_wall(now)]
        self._surfaces.update(untold, view, mates, mate_m, now)

    def forget_surfaces(self) -> None:
        """Compare the walls of scans to come with none that were seen so far: the pose has jumped."""
        self._surfaces = SurfaceWatch()

    def nearest(self, x: float, y: float, now: float) -> tuple[Feature, float] | None:
        """Return the obstacle of the newest scan nearest to (x, y) in `map`, and its distance [m]; None if there is
        none.
        """
        apart = [
            (min((px - x) ** 2 + (py - y) ** 2 for px, py in points), n) for n, (points, _) in enumerate(self._seen)
        ]
        if not apart:
            return None
        square, n = min(apart)
        thing = self._seen[n][1]
        return thing if isinstance(thing, Feature) else _feature(thing, now), sqrt(square)

    def shows(self, x: float, y: float, within_m: float) -> bool:
        """Return whether an obstacle of the newest scan, not a wall, has its centre within `within_m` of (x, y) in
        `map`.
        """
        things = (thing for _, thing in self._seen if isinstance(thing, _Track) or thing.kind != "wall")
        return any(hypot(thing.x - x, thing.y - y) < within_m for thing in things)

    def looks_through(self, place: Point) -> bool:
        """Return whether the newest scan looked through `place` in `map`."""
        return self._view is not None and self._view.shows_free(place)

    def features(self, now: float) -> list[Feature]:
        """Return all obstacles as of `now`."""
        walls = [thing for _, thing in self._seen if isinstance(thing, Feature)] + self._at_walls(now)
        return walls + [_feature(track, now) for track in self._tracks if now - track.seen_at <= FORGET_S]

    def moving(self, now: float) -> list[Feature]:
        return [_feature(t, now) for t in self._tracks if t.moves and now - t.seen_at <= FORGET_S] + self._at_walls(now)

    def _at_walls(self, now: float) -> list[Feature]:
        """Return what moves at walls in the newest scan."""
        later_s = now - self._seen_at
        return [
            Feature("moving", f.x + f.vx * later_s, f.y + f.vy * later_s, f.radius_m, f.vx, f.vy)
            for f in self._surfaces.moving
            if later_s <= FORGET_S
        ]

    def _follow(
        self, circle: tuple[float, float, float], ends: tuple[Point, Point], view: ScanView, now: float
    ) -> _Track | None:
        x, y, radius_m = circle
        best, best_m = None, inf
        for track in self._tracks:
            dt = now - track.seen_at
            apart = hypot(x - track.x - track.vx * dt, y - track.y - track.vy * dt)
            if dt > 0.0 and apart < min(best_m, NEXT_M + NEXT_MPS * dt, NEXT_M_MAX):
                best, best_m = track, apart
        if best is None:
            if len(self._tracks) >= TRACKS_MAX:
                return None
            self._tracks.append(_Track(x, y, radius_m, now, ends, [(now, ((x, y), *ends), view)]))
            return self._tracks[-1]
        dt = now - best.seen_at
        rx, ry = x - best.x - best.vx * dt, y - best.y - best.vy * dt
        best.x, best.y = x - (1.0 - ALPHA) * rx, y - (1.0 - ALPHA) * ry
        best.vx, best.vy = best.vx + BETA * rx / dt, best.vy + BETA * ry / dt
        best.radius_m = 0.7 * best.radius_m + 0.3 * radius_m
        best.seen_at, best.ends = now, ends
        if now - best.anchors[-1][0] >= ANCHOR_S:
            best.anchors = [*best.anchors[1 - ANCHORS_MAX :], (now, best.places(), view)]
            centers = [(at, center) for at, (center, *_), _ in best.anchors]
            best.restless = turns_often(centers, before=best.restless)
        moved = best.has_moved(view)
        best.slow = None if moved else best.slow_velocity(view)
        if moved or best.slow is not None:
            best.moved_at = now
        best.moves = now - best.moved_at <= TURNS_S
        return best


def turns_often(places: Sequence[tuple[float, Point]], *, before: bool = False) -> bool:
    """Return whether what was in `places` in `map` [m], at times [s] about a second apart, turns again and again;
    `before` is the answer of the last time.
    """
    steps = [
        ((bx - ax) / (until - at), (by - ay) / (until - at)) for (at, (ax, ay)), (until, (bx, by)) in pairwise(places)
    ]
    if len(steps) < STEPS_MIN or sum(hypot(*step) for step in steps) < LEAST_MPS * len(steps):
        return before
    changed = sum(hypot(bx - ax, by - ay) for (ax, ay), (bx, by) in pairwise(steps))
    both = sum(hypot(*a) + hypot(*b) for a, b in pairwise(steps))
    return changed > (STRAIGHT_SHARE if before else TURNING_SHARE) * both


def _clusters(points: Sequence[Point]) -> list[list[Point]]:
    """Return the runs of neighbouring points; the last run joins the first when they touch."""
    runs: list[list[Point]] = []
    run: list[Point] = []
    last_x = last_y = inf
    for point in points:
        x, y = point
        if hypot(x - last_x, y - last_y) < GAP_M:
            run.append(point)
        else:
            run = [point]
            runs.append(run)
        last_x, last_y = x, y
    if len(runs) > 1 and hypot(runs[0][0][0] - runs[-1][-1][0], runs[0][0][1] - runs[-1][-1][1]) < GAP_M:
        runs[0] = runs.pop() + runs[0]
    return runs


def _at_the_edge(cluster: Sequence[Point], eye: Point, reach_m: float) -> bool:
    return any(hypot(px - eye[0], py - eye[1]) > reach_m - EDGE_M for px, py in (cluster[0], cluster[-1]))


def _touches(cluster: Sequence[Point], x: float, y: float) -> bool:
    """Return whether a part may be a team-mate at (x, y): when that robot drives on, the rest would seem to move."""
    limit = TOUCH_M * TOUCH_M
    for px, py in cluster:  # noqa: SIM110 (a generator within `any` takes twice as long)
        if (dx := px - x) * dx + (dy := py - y) * dy < limit:
            return True
    return False


def _hidden(end: Point, beside: Point, eye: Point) -> bool:
    """Return whether the obstacle may continue behind a nearer one that is next to its end, seen from `eye`."""
    far, near = hypot(end[0] - eye[0], end[1] - eye[1]), hypot(beside[0] - eye[0], beside[1] - eye[1])
    if near > far - GAP_M:
        return False
    ex, ey, bx, by = end[0] - eye[0], end[1] - eye[1], beside[0] - eye[0], beside[1] - eye[1]
    # What is on the opposite side of the sensor, such as a follower, lies on the same line and hides nothing.
    return ex * bx + ey * by > 0.0 and abs(ex * by - ey * bx) < HIDDEN_RAD * near * far


def _circle(cluster: Sequence[Point], eye: Point) -> tuple[float, float, float]:
    """Return centre and radius of the visible points' obstacle: half their width, as far behind the nearest one."""
    (ax, ay), (bx, by) = cluster[0], cluster[-1]
    radius_m = max(0.5 * hypot(bx - ax, by - ay), 0.02)
    mx, my = 0.5 * (ax + bx) - eye[0], 0.5 * (ay + by) - eye[1]
    nearest_m = min([hypot(x - eye[0], y - eye[1]) for x, y in cluster])
    far = hypot(mx, my)
    if far < 1e-6:
        return ax, ay, radius_m
    reach = (nearest_m + radius_m) / far
    return eye[0] + mx * reach, eye[1] + my * reach, radius_m


def _extent(cluster: Sequence[Point]) -> float:
    """Return the diagonal [m] of the visible points' bounding box: a pocket seen from inside is wide as well."""
    xs, ys = [x for x, _ in cluster], [y for _, y in cluster]
    return hypot(max(xs) - min(xs), max(ys) - min(ys))


def _flat(cluster: Sequence[Point]) -> bool:
    (ax, ay), (bx, by) = cluster[0], cluster[-1]
    width = hypot(bx - ax, by - ay)
    dx, dy = bx - ax, by - ay
    bulge = max([abs(dx * (y - ay) - dy * (x - ax)) for x, y in cluster])
    return bulge < FLAT_SHARE * width * width


def _feature(track: _Track, now: float) -> Feature:
    dt = now - track.seen_at
    if not track.moves:
        return Feature("stationary", track.x, track.y, track.radius_m)
    vx, vy = track.slow or (track.vx, track.vy)
    keeps_s = KEEPS_S if track.restless else inf
    return Feature("moving", track.x + vx * dt, track.y + vy * dt, track.radius_m, vx, vy, keeps_s=keeps_s)
