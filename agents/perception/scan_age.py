"""Age of the last scan that counts, and the speed that it allows: a robot that sees nothing any more slows and stands.

A scanner that hangs publishes nothing, or its last scans again and again. A repeated scan counts as none once the robot
has moved far enough for its ranges to change. So does a scan in which no beam has measured anything, as under a cap or
with a dead laser or with limits that exclude each other; one in which all is gone that stood around the robot; one that
sees nothing near; and one that was made long before it arrived.
"""

from __future__ import annotations

from collections import deque
from itertools import pairwise
from math import cos, hypot, inf, isnan, pi, sin

from lfa.agents.perception.scan import READING_M_MIN
from lfa.protocol.geometry import STILL, Pose2D, Twist, distance, wrap
from lfa.protocol.messages.robot import NEAR_M_MAX, LaserScan
from lfa.protocol.topics import TOPIC

SCAN_S_MAX = TOPIC["scan"].timeout_s or 0.35
"""Age [s] of the last scan up to which it is as good as new; at twice this age the robot stands."""
PERIOD_S = 1.0 / (TOPIC["scan"].rate_hz or 10.0)
"""Time [s] between two scans that the braking margin assumes (`avoidance/safety.py`)."""
PERIOD_SLACK = 1.3
"""Period of the scans, as a multiple of `PERIOD_S`, up to which the margin covers it."""
PERIODS = 5
"""Number of periods whose median is taken."""
LOST_S = 5.0
"""Age [s] of the last scan from which a robot counts as stuck (S5), so that its chain goes on without it."""
MOVED_M, MOVED_RAD = 0.05, 0.05
"""Motion since the last scan that counted, after which an equal scan cannot be a new one."""
REPEATS = 10
"""Number of scans that are remembered: a driver may repeat the turns that its buffer holds."""
GONE_SHARE, GONE_BEAMS, GONE_REACH, GONE_M = 0.25, 12, 0.7, 0.5
"""Share of the beams, and their least number, that had a reading within a share of the range: while the robot has moved
less than GONE_M [m], they cannot all have none. Fewer beams may all have been on one thing that was taken away."""
FACES_MIN, ACROSS = 3, 0.5
"""Number of neighbouring beams on surfaces across the motion, and the least share of the motion across a surface, from
which a motion must have changed the scan: between two long walls a robot may well see the same again."""


class ScanAge:
    """Age of the last scan that counts. A robot that never had a scan has no scanner, and is not limited."""

    def __init__(self) -> None:
        self._known: deque[tuple[tuple[float, ...], Pose2D]] = deque(maxlen=REPEATS)
        """Ranges of the newest scans that differ, and the pose at which each was first seen; the newest comes last."""
        self._at: float | None = None
        self._periods: deque[float] = deque(maxlen=PERIODS)
        self.slow_hz: float | None = None
        """Rate [Hz] of the scans, if it is lower than the braking margin assumes; None otherwise."""

    def update(self, scan: LaserScan, pose: Pose2D, now: float, late_s: float = 0.0) -> bool:
        """Take a scan made at `pose` in `map`, which took `late_s` [s] to arrive; return whether it counts."""
        if late_s > SCAN_S_MAX or not _has_measured(scan) or self._is_gone(scan, pose):
            if self._at is None:  # there is a scanner, and its age counts from its first message
                self._at = now
            return False
        before = _pose_of(scan.ranges_m, self._known)
        if before is None:
            self._known.append((scan.ranges_m, pose))
        elif _must_differ(scan, before, pose):
            return False
        if self._at is not None:
            self._periods.append(now - self._at)
            self.slow_hz = _slow_hz(self._periods)
        self._at = now
        return True

    def _is_gone(self, scan: LaserScan, pose: Pose2D) -> bool:
        """Return whether `scan` shows nothing at all where the newest scan that counts showed much."""
        if not self._known or any(r < inf for r in scan.ranges_m):
            return False
        ranges_m, seen_from = self._known[-1]
        near = sum(scan.range_min_m < r < GONE_REACH * scan.range_max_m for r in ranges_m)
        return near >= max(GONE_SHARE * len(ranges_m), GONE_BEAMS) and distance(seen_from, pose) < GONE_M

    def age_s(self, now: float) -> float:
        """Return the age [s] of the last scan that counts; 0 for a robot without a scanner."""
        return 0.0 if self._at is None else now - self._at

    def lost(self, now: float) -> bool:
        """Return whether the robot stands for want of a scan."""
        return self.age_s(now) >= 2.0 * SCAN_S_MAX

    def speed_max_mps(self, usual_mps: float) -> float:
        """Return the speed [m/s] at which a robot drives no farther from scan to scan than at `usual_mps` with scans
        of the assumed rate.
        """
        return usual_mps if self.slow_hz is None else usual_mps * PERIOD_S * self.slow_hz

    def limited(self, wanted: Twist, now: float) -> Twist:
        """Return `wanted`, scaled down from `SCAN_S_MAX` on, to a stop at twice that age."""
        share = 2.0 - self.age_s(now) / SCAN_S_MAX
        if share >= 1.0:
            return wanted
        return STILL if share <= 0.0 else Twist(share * wanted.linear_x, share * wanted.angular_z)


def _slow_hz(periods: deque[float]) -> float | None:
    if len(periods) < PERIODS:
        return None
    period_s = sorted(periods)[PERIODS // 2]
    return 1.0 / period_s if period_s > PERIOD_SLACK * PERIOD_S else None


def _has_measured(scan: LaserScan) -> bool:
    """Return whether any beam has a reading: a distance, or nothing within the range.

    None has where the limits exclude each other, or all beams point the same way: such a scan shows no obstacle, as a
    free room does.
    """
    low = max(scan.range_min_m, READING_M_MIN)
    spread = len(scan.ranges_m) < 2 or 0.0 < abs(scan.angle_increment) <= pi
    return low < scan.range_max_m and low <= NEAR_M_MAX and spread and any(r >= low for r in scan.ranges_m)


def _pose_of(ranges_m: tuple[float, ...], known: deque[tuple[tuple[float, ...], Pose2D]]) -> Pose2D | None:
    """Return the pose of the scan in `known` that has these ranges, beam by beam; None if there is none.

    A bad beam, nan, equals a bad beam; without one, scans are equal as tuples or not at all.
    """
    bad = isnan(sum(ranges_m))
    for others_m, pose in known:
        if ranges_m == others_m or (bad and _are_equal(ranges_m, others_m)):
            return pose
    return None


def _are_equal(ranges_m: tuple[float, ...], others_m: tuple[float, ...]) -> bool:
    if len(ranges_m) != len(others_m):
        return False
    pairs = zip(ranges_m, others_m, strict=True)
    return all(r == o or (r != r and o != o) for r, o in pairs)  # noqa: PLR0124


def _must_differ(scan: LaserScan, before: Pose2D, now: Pose2D) -> bool:
    """Return whether the motion from `before` to `now` must have changed the ranges of `scan`."""
    seen = {r for r in scan.ranges_m if r < inf}
    if not seen:
        return False
    if abs(wrap(now.theta - before.theta)) > MOVED_RAD:
        return len(seen) > 1
    if distance(before, now) <= MOVED_M:
        return False
    dx, dy = now.x - before.x, now.y - before.y
    c, s, way_m = cos(before.theta), sin(before.theta), hypot(dx, dy)
    ahead, left = (c * dx + s * dy) / way_m, (c * dy - s * dx) / way_m
    return _faces(scan, ahead, left) >= FACES_MIN


def _faces(scan: LaserScan, ahead: float, left: float) -> int:
    """Return the number of neighbouring beams whose surface lies across the direction (`ahead`, `left`)."""
    angles = (scan.angle_min + n * scan.angle_increment for n in range(len(scan.ranges_m)))
    points = [(r * cos(a), r * sin(a)) if 0.0 < r < inf else None for r, a in zip(scan.ranges_m, angles, strict=True)]
    count = 0
    for p, q in pairwise(points):
        if p is not None and q is not None:
            along_x, along_y = q[0] - p[0], q[1] - p[1]
            length = hypot(along_x, along_y)
            count += length > 0.0 and abs(ahead * along_y - left * along_x) > ACROSS * length
    return count
