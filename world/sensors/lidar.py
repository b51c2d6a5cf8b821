"""Ray casting of all robots' laser scanners in one batch: numpy over (robot, shape) pairs, no loop over beams.

A shape covers an interval of angles, and only the beams in that interval are tested: the cost grows with the visible
shapes, not with beams times shapes. Beams run counter-clockwise, those of a full turn from behind the scanner: beam j
of `cast` points to `ANGLE_MIN` + j TAU/beams in the scanner's frame.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from math import cos, pi, sin
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from msgspec.structs import replace

from lfa.protocol.geometry import TAU, Pose2D, compose
from lfa.world.description.scenario import Lidar, Obstacle, Scenario

OVERLAP_SEEN = 0.9
"""Distance of two robots' centres, as a fraction of two radii, below which they do not see each other."""
ANGLE_MIN = -pi
ROUNDING = 1e-9
"""Angular tolerance as a fraction of a beam's width, so that a beam through a corner hits at least one of its edges."""

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
Circle = tuple[float, float, float]
Segment = tuple[float, float, float, float]


class Scanner:
    """Laser scanners of all robots of one scenario."""

    def __init__(self, scenario: Scenario) -> None:
        self._lidar = scenario.world.lidar
        self._radius_m = scenario.mission.radius_m
        self._footprint_m = scenario.world.body.footprint_m
        self._mount = Pose2D(*self._lidar.mount)
        lidar, turn = self._lidar, self._lidar.beams_a_turn
        self._turn = replace(lidar, beams=turn, fov_rad=TAU)
        self._first = (turn - lidar.beams + 1) // 2
        self._obstacles = scenario.world.obstacles
        self._walls_m = scenario.world.walls_m
        self._fix()

    def set_down(self, obstacle: Obstacle) -> None:
        """Add a fixed obstacle at the end of the scenario's list."""
        self._obstacles = (*self._obstacles, obstacle)
        self._fix()

    def _fix(self) -> None:
        """Outline the walls and the fixed obstacles once, for all scans."""
        fixed = [o for o in self._obstacles if o.mass_kg is None and not o.moves]
        circles, segments = outline((obstacle, Pose2D(*obstacle.center_m)) for obstacle in fixed)
        self._circles = np.array(circles, dtype=float).reshape(-1, 3)
        self._segments = np.array([*self._walls_m, *segments], dtype=float).reshape(-1, 4)

    def scan(self, robots: Sequence[Pose2D], moved: Mapping[int, Pose2D]) -> Floats:
        """Return the exact ranges [m] from each scanner, shape (robots, beams), counter-clockwise through its field of
        view; `moved` holds the obstacles that are not fixed.

        Beyond `range_max_m` is +inf, below `range_min_m` is -inf (REP-117).
        """
        poses = np.array([(pose.x, pose.y, pose.theta) for pose in robots])
        circles, segments = self._circles, self._segments
        if moved:
            more_circles, more_segments = outline((self._obstacles[n], pose) for n, pose in moved.items())
            circles = np.concatenate((circles, np.array(more_circles, dtype=float).reshape(-1, 3)))
            segments = np.concatenate((segments, np.array(more_segments, dtype=float).reshape(-1, 4)))
        eyes = poses
        if self._mount != Pose2D():
            mounted = (compose(pose, self._mount) for pose in robots)
            eyes = np.array([(pose.x, pose.y, pose.theta) for pose in mounted])
        bodies = robot_outlines(poses, self._footprint_m, self._radius_m)
        ranges = cast(eyes, bodies, circles, segments, self._turn)
        return ranges[:, self._first : self._first + self._lidar.beams]


def outline(placed: Iterable[tuple[Obstacle, Pose2D]]) -> tuple[list[Circle], list[Segment]]:
    """Return the circles (x, y, radius) and segments (x1, y1, x2, y2) in `map` of obstacles at their poses."""
    circles: list[Circle] = []
    segments: list[Segment] = []
    for obstacle, pose in placed:
        if obstacle.radius_m is not None:
            circles.append((pose.x, pose.y, obstacle.radius_m))
            continue
        c, s = cos(pose.theta), sin(pose.theta)
        corners = [(pose.x + c * x - s * y, pose.y + s * x + c * y) for x, y in obstacle.corners_m or ()]
        segments.extend((*a, *b) for a, b in pairwise((*corners, corners[0])))
    return circles, segments


class RobotBodies(NamedTuple):
    """Bodies of all robots: circles (x, y, radius) in `map`, and the sides of those that are polygons."""

    circles: Floats
    sides: Floats
    """Segments in `map`, as many for each robot as its polygon has sides; none for round robots."""


def robot_outlines(poses: Floats, footprint_m: Sequence[tuple[float, float]], radius_m: float) -> RobotBodies:
    """Return the bodies of robots at `poses` (x, y, theta) in `map`."""
    circles = np.column_stack((poses[:, :2], np.full(len(poses), radius_m)))
    if not footprint_m:
        return RobotBodies(circles, np.empty((0, 4)))
    corners = np.array(footprint_m)
    c, s = np.cos(poses[:, 2:]), np.sin(poses[:, 2:])
    x = poses[:, 0:1] + c * corners[:, 0] - s * corners[:, 1]
    y = poses[:, 1:2] + s * corners[:, 0] + c * corners[:, 1]
    sides = np.stack((x, y, np.roll(x, -1, axis=1), np.roll(y, -1, axis=1)), axis=2)
    return RobotBodies(circles, sides.reshape(-1, 4))


def cast(eyes: Floats, bodies: RobotBodies, circles: Floats, segments: Floats, lidar: Lidar) -> Floats:
    """Return ranges [m] of shape (n, beams) from the scanners' n poses `eyes` (x, y, theta) in `map`, each on the robot
    of the same number in `bodies`, which it does not see.
    """
    ranges = np.full((len(eyes), lidar.beams), np.inf)
    flat = ranges.reshape(-1)
    sees = _sees(bodies.circles)
    sides = len(bodies.sides) // len(eyes)
    round_ones = np.zeros_like(sees) if sides else sees
    _cast_at_circles(flat, eyes, np.concatenate((bodies.circles, circles)), round_ones, lidar)
    if sides:
        segments = np.concatenate((bodies.sides, segments))
    if len(segments):
        _cast_at_segments(flat, eyes, segments, np.repeat(sees, sides, axis=1), lidar)
    flat[flat > lidar.range_max_m] = np.inf
    flat[flat < lidar.range_min_m] = -np.inf
    return ranges


def _sees(circles: Floats) -> Bools:
    """Return of each robot which others it sees: not itself, and none in whose place it stands.

    Only robots that started at the same place overlap; they do not interact until they separate (rigid_bodies.py).
    """
    dx = circles[:, 0] - circles[:, 0:1]
    dy = circles[:, 1] - circles[:, 1:2]
    sees: Bools = np.sqrt(dx * dx + dy * dy) > OVERLAP_SEEN * 2.0 * circles[:, 2]
    return sees


def _cast_at_circles(flat: Floats, poses: Floats, circles: Floats, sees: Bools, lidar: Lidar) -> None:
    """Reduce the ranges in `flat` by the hits on circles; the first n are the robots, where `sees` says so."""
    dx = circles[:, 0] - poses[:, 0:1]
    dy = circles[:, 1] - poses[:, 1:2]
    away = np.sqrt(dx * dx + dy * dy)
    seen = away < lidar.range_max_m + circles[:, 2]
    seen[:, : len(poses)] &= sees
    robot, shape = np.nonzero(seen)
    if not len(robot):
        return
    away, radius = away[robot, shape], circles[shape, 2]
    toward = np.arctan2(dy[robot, shape], dx[robot, shape]) - poses[robot, 2] - ANGLE_MIN
    half = np.where(away > radius, np.arcsin(np.minimum(radius / np.maximum(away, 1e-12), 1.0)), pi)
    pair, turn, beam = _beams_within(toward - half, toward + half, robot, lidar.beams)
    offset = turn - toward[pair]
    away, radius = away[pair], radius[pair]
    across = away * np.sin(offset)
    ranges = away * np.cos(offset) - np.sqrt(np.maximum(radius * radius - across * across, 0.0))
    np.minimum.at(flat, beam, ranges)


def _cast_at_segments(flat: Floats, poses: Floats, segments: Floats, sees: Bools, lidar: Lidar) -> None:
    """Reduce the ranges in `flat` by the hits on segments; the first are robots' sides, where `sees` says so."""
    ax, ay = segments[:, 0] - poses[:, 0:1], segments[:, 1] - poses[:, 1:2]
    ex, ey = segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1]
    along = np.clip(-(ax * ex + ay * ey) / (ex * ex + ey * ey), 0.0, 1.0)
    nx, ny = ax + along * ex, ay + along * ey
    nearest = np.sqrt(nx * nx + ny * ny)
    seen = nearest < lidar.range_max_m
    seen[:, : sees.shape[1]] &= sees
    robot, shape = np.nonzero(seen)
    if not len(robot):
        return
    ax, ay, nearest = ax[robot, shape], ay[robot, shape], nearest[robot, shape]
    ex, ey = ex[shape], ey[shape]
    bx, by = ax + ex, ay + ey
    heading = poses[robot, 2] + ANGLE_MIN
    first = np.arctan2(ay, ax)
    swept = np.arctan2(ax * by - ay * bx, ax * bx + ay * by)
    start = np.where(swept < 0.0, first + swept, first) - heading
    # Range = distance to the line / cos(angle between beam and normal).
    area = ax * ey - ay * ex
    height = area / np.sqrt(ex * ex + ey * ey)
    normal = np.arctan2(-ex, ey) - heading
    farthest = np.sqrt(np.maximum(ax * ax + ay * ay, bx * bx + by * by))
    pair, turn, beam = _beams_within(start, start + np.abs(swept), robot, lidar.beams)
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges = height[pair] / np.cos(turn - normal[pair])
    # Seen edge-on the quotient is 0/0 or undefined: the range is then that of the nearest point (fmax ignores nan).
    ranges = np.minimum(np.fmax(ranges, nearest[pair]), farthest[pair])
    np.minimum.at(flat, beam, ranges)


def _beams_within(low: Floats, high: Floats, robot: Ints, beams: int) -> tuple[Ints, Floats, Ints]:
    """Return pair index, angle [rad] from beam 0 and flat index of every beam with low <= angle <= high."""
    width = TAU / beams
    first = np.ceil(low / width - ROUNDING).astype(np.int64)
    count = np.minimum(np.floor(high / width + ROUNDING).astype(np.int64) - first + 1, beams)
    ends = np.cumsum(count)
    pair = np.repeat(np.arange(len(count)), count)
    number = np.arange(ends[-1]) + np.repeat(first - (ends - count), count)
    return pair, number * width, np.repeat(robot * beams, count) + number % beams
