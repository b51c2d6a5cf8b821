"""Clock offset of a sender relative to the own clock: between machines only differences of stamps have a meaning.

Receive minus send is the clock offset plus the message's latency, so its windowed minimum is the offset plus the least
latency. The least values of windows of one second form a lower envelope; the line below it that touches at the middle
(the edge of the lower convex hull there) gives offset and drift together, so that a drift of 200 ppm does not age a
minimum. When the peer reports its own least delay of our messages, half the difference of the two is the offset without
the common latency: only the path's asymmetry is left.
"""

from __future__ import annotations

from itertools import pairwise
from math import isfinite

BUCKET_S = 1.0
BUCKETS_MAX = 16
DRIFT_MAX = 250e-6
"""Maximum drift: crystals are within 100 ppm each; two of them and a margin."""
DRIFT_SPAN_S = 6.0
"""Minimum length [s] of the envelope for a drift estimate."""
FUTURE_MAX_S = 0.1
"""Time [s] ahead of the estimate beyond which a stamp is refused, until `FUTURES_TO_RESET` in a row agree."""
FUTURES_TO_RESET = 10
REPORT_TIMEOUT_S = 10.0


class ClockOffset:
    """Clock offset of one sender in one incarnation. Create a new one when its incarnation changes."""

    # A robot keeps one for each of its team, of which most are heard seldom: it is small.
    __slots__ = (
        "_anchor", "_bucket_end", "_buckets", "_drift", "_futures", "_report", "_value", "refused", "resets",
    )  # fmt: skip

    def __init__(self) -> None:
        self._buckets: list[tuple[float, float]] = []
        self._bucket_end = 0.0
        self._anchor = 0.0
        self._value = 0.0
        self._drift = 0.0
        self._report: tuple[float, float] | None = None
        self._futures = 0
        self.refused = 0
        self.resets = 0

    def heard(self, stamp: float, received_at: float) -> bool:
        """Update with a message that was stamped `stamp`.

        Return False when the stamp is not finite or lies in the future, or when the own time ran backwards.
        """
        delay = received_at - stamp
        if not isfinite(delay) or (self._buckets and received_at < self._buckets[-1][0]):
            self.refused += 1
            return False
        if not self._buckets:
            self._begin(received_at, delay)
            return True
        below = delay - self.least(received_at)
        if below < -FUTURE_MAX_S:
            return self._future(received_at, delay)
        self._futures = 0
        if received_at >= self._bucket_end:
            self._refit(received_at)
            self._buckets.append((received_at, delay))
            del self._buckets[:-BUCKETS_MAX]
            self._bucket_end = received_at + BUCKET_S
        elif delay < self._buckets[-1][1]:
            self._buckets[-1] = (received_at, delay)
        self._value += min(0.0, delay - self.least(received_at))
        return True

    def reported(self, least_s: float, received_at: float) -> None:
        """Update with the peer's own least (receive - send) of our messages, from its `TableRow.delays`."""
        if isfinite(least_s):
            self._report = (received_at, least_s)

    @property
    def known(self) -> bool:
        return bool(self._buckets)

    def least(self, now: float) -> float:
        """Return the least (receive - send) as of `now` [s], which `TableRow.delays` reports to this sender."""
        return self._value + self._drift * (now - self._anchor)

    def offset(self, now: float) -> float:
        """Return the time [s] to add to the sender's stamps to convert them to the own clock."""
        least = self._value + self._drift * (now - self._anchor)
        if self._report is None or now - self._report[0] > REPORT_TIMEOUT_S:
            return least
        reported_at, theirs = self._report
        round_trip = least + theirs - self._drift * (now - reported_at)
        return least - 0.5 * round_trip if round_trip > 0.0 else least

    @property
    def drift(self) -> float:
        """Fraction by which the sender's clock runs slower."""
        return self._drift

    def _begin(self, now: float, delay: float) -> None:
        self._buckets.clear()
        self._buckets.append((now, delay))
        self._bucket_end = now + BUCKET_S
        self._anchor, self._value, self._drift = now, delay, 0.0
        self._futures = 0

    def _future(self, now: float, delay: float) -> bool:
        self._futures += 1
        if self._futures < FUTURES_TO_RESET:
            self.refused += 1
            return False
        self.resets += 1
        self._report = None
        self._begin(now, delay)
        return True

    def _refit(self, now: float) -> None:
        """Fit the line below all windows' minima that is nearest to them on average."""
        points = self._buckets
        first, last = points[0][0], points[-1][0]
        self._anchor = now
        if last - first < DRIFT_SPAN_S:
            self._drift = 0.0
            self._value = min(delay for _, delay in points)
            return
        hull = _lower_hull(points)
        middle = 0.5 * (first + last)
        for (t0, d0), (t1, d1) in pairwise(hull):
            if t1 >= middle:
                self._drift = max(-DRIFT_MAX, min(DRIFT_MAX, (d1 - d0) / (t1 - t0)))
                break
        self._value = min(delay + self._drift * (now - t) for t, delay in points)


def _lower_hull(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    hull: list[tuple[float, float]] = []
    for t, d in points:
        while len(hull) >= 2:
            (t0, d0), (t1, d1) = hull[-2], hull[-1]
            if (d1 - d0) * (t - t1) < (d - d1) * (t1 - t0):
                break
            hull.pop()
        hull.append((t, d))
    return hull
