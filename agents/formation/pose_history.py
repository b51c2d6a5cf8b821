"""History of a predecessor: its states over time (control.md 5.2), and its path over arc length (5.5).

The buffer returns the state at a time t, interpolated between received stamps, so that a loss has an effect only if a
gap is longer than the buffer. The trace returns the point of the path at a distance k behind the predecessor.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from math import cos, hypot, sin

from msgspec import Struct

from lfa.agents.config import CONTROL_PERIOD_S
from lfa.protocol.geometry import Pose2D, Twist, along_arc, between, compose, part_of_arc, sinc, wrap

SAMPLES_MAX = 64
SPACING_M = 0.02
SAME_PLACE_M = 0.15
BEYOND_M = 0.1
"""Distance [m] driven back beyond the kept path after which it begins anew: more than noise adds up to in a turn."""


class Sample(Struct, frozen=True, gc=False):
    """State at `stamp` of the sender's clock, with its arc length on the path."""

    stamp: float
    pose: Pose2D
    twist: Twist
    travelled_m: float


class JitterBuffer:
    """Newest samples in the order of their stamps, for any order of arrival."""

    def __init__(self, *, with_velocity: bool, period_s: float = CONTROL_PERIOD_S) -> None:
        self._with_velocity = with_velocity
        self._period_s = period_s
        self._samples: deque[Sample] = deque(maxlen=SAMPLES_MAX)

    def clear(self) -> None:
        self._samples.clear()

    @property
    def newest(self) -> Sample:
        return self._samples[-1]

    def add(self, sample: Sample) -> None:
        """Append a sample with the newest stamp so far."""
        self._samples.append(sample)

    def insert_late(self, stamp: float, pose: Pose2D, twist: Twist) -> bool:
        """Insert a sample that others overtook; return False when it does not fit between its neighbours."""
        samples = self._samples
        for index in range(len(samples) - 1, 0, -1):
            if samples[index - 1].stamp < stamp < samples[index].stamp:
                expected = _between(samples[index - 1], samples[index], stamp, self._with_velocity)
                if hypot(pose.x - expected.pose.x, pose.y - expected.pose.y) > SAME_PLACE_M:
                    return False
                if len(samples) == SAMPLES_MAX:
                    samples.popleft()
                    index -= 1
                samples.insert(index, Sample(stamp, pose, twist, expected.travelled_m))
                return True
        return False

    def at(self, stamp: float) -> Sample | None:
        """Return the state at `stamp`; None when that is later than all samples.

        From poses alone, the velocity is that of the control period which begins at `stamp`: a follower that drives it
        is where its target is at the end. A slope of the past would lag, and the lag would grow along the chain.
        """
        sample = self._find(stamp)
        if self._with_velocity or sample is None:
            return sample
        end = self._find(min(stamp + self._period_s, self._samples[-1].stamp))
        if end is None or end.stamp - stamp < 0.5 * self._period_s:
            return sample
        return Sample(stamp, sample.pose, _mean_twist(sample, end), sample.travelled_m)

    def _find(self, stamp: float) -> Sample | None:
        samples = self._samples
        later = samples[-1]
        if stamp > later.stamp:
            return None
        for index in range(len(samples) - 2, -1, -1):
            earlier = samples[index]
            if earlier.stamp <= stamp:
                return _between(earlier, later, stamp, self._with_velocity)
            later = earlier
        return _before(later, stamp)


def _between(a: Sample, b: Sample, stamp: float, with_velocity: bool) -> Sample:
    """Interpolate on the arc from `a` to `b`: by the published speeds, or evenly when only poses are known."""
    h = b.stamp - a.stamp
    part = (stamp - a.stamp) / h
    step = between(a.pose, b.pose)
    way = b.travelled_m - a.travelled_m
    va, vb = a.twist.linear_x, b.twist.linear_x
    along = part
    if with_velocity:
        twist = Twist(va + part * (vb - va), a.twist.angular_z + part * (b.twist.angular_z - a.twist.angular_z))
        if va * vb > 0.0:
            along = part * (va + 0.5 * part * (vb - va)) / (0.5 * (va + vb))
    else:
        twist = _mean_twist(a, b)
    return Sample(stamp, compose(a.pose, part_of_arc(step, along)), twist, a.travelled_m + along * way)


def _mean_twist(a: Sample, b: Sample) -> Twist:
    h = b.stamp - a.stamp
    return Twist((b.travelled_m - a.travelled_m) / h, wrap(b.pose.theta - a.pose.theta) / h)


def _before(oldest: Sample, stamp: float) -> Sample:
    """Extrapolate before the oldest sample, as if it had been reached with its own twist."""
    back = max(stamp - oldest.stamp, -1.0)
    travelled_m = oldest.travelled_m + oldest.twist.linear_x * back
    return Sample(stamp, along_arc(oldest.pose, oldest.twist, back), oldest.twist, travelled_m)


class TracePoint(Struct, frozen=True, gc=False):
    x: float
    y: float
    theta: float
    curvature: float


class PoseHistory:
    """Path by arc length [m]. Where the predecessor reverses, the path is shortened."""

    def __init__(self, length_m: float) -> None:
        self._length_m = length_m
        self._s: list[float] = []
        self._poses: list[Pose2D] = []
        self._last: Pose2D | None = None
        self.travelled_m = 0.0

    def add(self, pose: Pose2D) -> float:
        """Add the predecessor's present pose; return its arc length there."""
        if self._last is None:
            self._last = pose
            self._push(pose)
            return self.travelled_m
        self.travelled_m += arc_length(self._last, pose)
        self._last = pose
        while len(self._s) > 1 and self._s[-1] > self.travelled_m:
            self._s.pop()
            self._poses.pop()
        if self._s[-1] - self.travelled_m > BEYOND_M:  # back beyond what is kept
            self._s[-1], self._poses[-1] = self.travelled_m, pose
        if self.travelled_m - self._s[-1] >= SPACING_M:
            self._push(pose)
        return self.travelled_m

    def jump(self, pose: Pose2D) -> None:
        """Join the path by a straight line to `pose`, where the predecessor jumped or another robot takes over."""
        if self._last is None:
            self.add(pose)
            return
        self.travelled_m = self._s[-1] + max(SPACING_M, hypot(pose.x - self._poses[-1].x, pose.y - self._poses[-1].y))
        self._last = pose
        self._push(pose)

    def at(self, s: float) -> TracePoint:
        """Return the point at arc length `s`; beyond either end the path is extended straight. Needs one `add`
        before.
        """
        index = bisect_right(self._s, s)
        if index == 0:
            return _straight(self._poses[0], s - self._s[0])
        if index == len(self._s):
            return _straight(self._poses[-1], s - self._s[-1])
        return _hermite(self._poses[index - 1], self._poses[index], self._s[index - 1], self._s[index], s)

    def _push(self, pose: Pose2D) -> None:
        self._s.append(self.travelled_m)
        self._poses.append(pose)
        if self._s[-1] - self._s[0] > 2.0 * self._length_m:
            keep = bisect_right(self._s, self._s[-1] - self._length_m)
            del self._s[:keep], self._poses[:keep]


def arc_length(a: Pose2D, b: Pose2D) -> float:
    """Return the signed distance [m] from `a` to `b`, driven as an arc: negative when backwards."""
    half = 0.5 * wrap(b.theta - a.theta)
    middle = a.theta + half
    return (cos(middle) * (b.x - a.x) + sin(middle) * (b.y - a.y)) / sinc(half)


def _straight(pose: Pose2D, s: float) -> TracePoint:
    return TracePoint(pose.x + s * cos(pose.theta), pose.y + s * sin(pose.theta), pose.theta, 0.0)


def _hermite(a: Pose2D, b: Pose2D, sa: float, sb: float, s: float) -> TracePoint:
    """Interpolate by a cubic between two poses, with their headings as tangents."""
    h = sb - sa
    u = (s - sa) / h
    turn = wrap(b.theta - a.theta)
    u2 = u * u
    b1 = u2 * (3.0 - 2.0 * u)
    ta, tb = h * u * (1.0 - u) * (1.0 - u), h * u2 * (u - 1.0)
    x = a.x + b1 * (b.x - a.x) + ta * cos(a.theta) + tb * cos(b.theta)
    y = a.y + b1 * (b.y - a.y) + ta * sin(a.theta) + tb * sin(b.theta)
    return TracePoint(x, y, wrap(a.theta + u * turn), turn / h)
