"""Estimate of a follower's predecessor: its messages in, its state at a time of the follower's own clock out.

Joins the clock offset, the observer, and for long chains the jitter buffer and the trace. A short chain uses the
predecessor's present state (dead reckoning, no lag); a long one its state `delay_s` ago (control.md 5.2).
"""

from __future__ import annotations

from math import isfinite

from msgspec import Struct

from lfa.agents.config import CONTROL_PERIOD_S
from lfa.agents.following.observer import Mode, Observer
from lfa.agents.formation.pose_history import JitterBuffer, PoseHistory, Sample
from lfa.agents.localization.clock_offset import ClockOffset
from lfa.agents.localization.plausibility import plausible
from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.incarnations import is_later
from lfa.protocol.messages.team import PoseStamped
from lfa.protocol.topics import TOPIC

DEAD_RECKONING_FOLLOWERS_MAX = 3
"""Number of followers above which the buffer is used (control.md 5.1: dead reckoning amplifies along a chain)."""
TRACE_MARGIN_M = 2.0
DELAY_MIN_S = 0.04
DELAY_MAX_S = 0.4
DELAY_SPARE_S = 0.04
"""Margin [s] of two message periods: the buffer bridges two losses in a row."""
DELAY_RATE = 0.05
"""Rate [s/s] at which the delay changes: a change alters the predecessor's apparent speed."""
AGE_WINDOW_S = 10.0
POSE_S_MAX = TOPIC["pose"].timeout_s or 0.0


class Sighting(Struct, frozen=True):
    """State of the predecessor as the follower uses it."""

    robot: int
    epoch: int
    """Number that changes when the estimate restarts: the predecessor jumped or restarted."""
    pose: Pose2D
    twist: Twist
    age_s: float
    """Time [s] by which the state was extrapolated beyond the newest message."""
    delay_s: float
    """Age [s] of the state that is intended."""
    travelled_m: float
    """Arc length [m] of `pose` on `trace`."""
    trace: PoseHistory


class Predecessor:
    """Estimate of one robot as predecessor; create a new one when the chain changes."""

    def __init__(
        self,
        robot: int,
        *,
        mode: Mode = "velocity",
        extrapolation_max_s: float = 0.5,
        delay_s: float | None = 0.0,
        period_s: float = CONTROL_PERIOD_S,
        trace_m: float = 4.0,
        trace: PoseHistory | None = None,
    ) -> None:
        """Create an estimate. `delay_s` 0 dead-reckons; None adapts a buffer to the measured ages of the messages.
        `period_s` is the follower's control period.

        `trace` is the path of the former predecessor, when the chain closes over it.
        """
        self.robot = robot
        self.clock = ClockOffset()
        self.trace = trace or PoseHistory(trace_m + TRACE_MARGIN_M)
        self._joining = trace is not None
        self._mode: Mode = mode
        self._extrapolation_max_s = extrapolation_max_s
        self._observer = Observer(mode, extrapolation_max_s)
        self._buffer = JitterBuffer(with_velocity=mode == "velocity", period_s=period_s)
        self._automatic = delay_s is None
        self._delay_s = DELAY_MIN_S if delay_s is None else delay_s
        self._oldest = _WindowedMaximum()
        self._asked_at: float | None = None
        self._incarnation: int | None = None
        self._heard_at = float("-inf")
        self._jumps = 0
        self.epoch = 0
        self.refused = 0
        """Number of messages that were not finite, implausible, from the future, of an older incarnation, or single
        outliers."""

    @property
    def delay_s(self) -> float:
        return self._delay_s

    def heard(self, message: PoseStamped, received_at: float) -> bool:
        """Update with a published pose; return False when it is refused."""
        header = message.header
        if header.incarnation != self._incarnation and not self._restart(header.incarnation, received_at):
            self.refused += 1
            return False
        self._heard_at = received_at
        pose = Pose2D(message.x, message.y, message.theta)
        if not (isfinite(header.stamp) and plausible(pose, message.twist)):
            self.refused += 1
            return False
        if not self.clock.heard(header.stamp, received_at):
            self.refused += 1
            return False
        newest = self._observer.stamp
        if newest is not None and header.stamp <= newest:
            return self._buffer.insert_late(header.stamp, pose, message.twist)
        if not self._observer.heard(header.stamp, pose, message.twist):
            self.refused += 1
            return False
        if self._automatic:
            self._oldest.add(received_at, received_at - header.stamp - self.clock.offset(received_at))
        self._remember(header.stamp, pose, message.twist)
        return True

    def at(self, now: float) -> Sighting | None:
        """Return the predecessor as of `now` (own clock), or as of `now - delay_s`; None before the first message."""
        newest = self._observer.stamp
        if newest is None:
            return None
        if self._automatic:
            self._adapt(now)
        stamp = now - self.clock.offset(now) - self._delay_s
        if self._delay_s > 0.0:
            sample = self._buffer.at(stamp)
            if sample is not None:
                return self._sighting(sample.pose, sample.twist, 0.0, sample.travelled_m)
        pose, twist, age = self._observer.at(stamp)
        reach = min(self._extrapolation_max_s, max(-self._extrapolation_max_s, age))
        return self._sighting(pose, twist, age, self._buffer.newest.travelled_m + twist.linear_x * reach)

    def _sighting(self, pose: Pose2D, twist: Twist, age_s: float, travelled_m: float) -> Sighting:
        return Sighting(
            self.robot, self.epoch, pose, twist, age_s if age_s > 0.0 else 0.0, self._delay_s, travelled_m, self.trace
        )

    def _restart(self, incarnation: int, now: float) -> bool:
        """Restart for another incarnation, which has another clock.

        Return False for an earlier incarnation, as long as the later one was heard within its freshness limit: a single
        stray number must not silence the predecessor (E23).
        """
        if self._incarnation is not None:
            if is_later(self._incarnation, incarnation) and now - self._heard_at <= POSE_S_MAX:
                return False
            self.epoch += 1
            self._joining = True
        self._incarnation = incarnation
        self.clock = ClockOffset()
        self._observer = Observer(self._mode, self._extrapolation_max_s)
        self._jumps = 0
        self._buffer.clear()
        return True

    def _remember(self, stamp: float, pose: Pose2D, twist: Twist) -> None:
        if self._observer.jumps != self._jumps or self._joining:
            self.epoch += self._observer.jumps != self._jumps
            self._jumps = self._observer.jumps
            self._joining = False
            self._buffer.clear()
            self.trace.jump(pose)
        else:
            self.trace.add(pose)
        self._buffer.add(Sample(stamp, pose, twist, self.trace.travelled_m))

    def _adapt(self, now: float) -> None:
        """Move the delay towards the worst recent age plus what two losses in a row need."""
        elapsed = 0.0 if self._asked_at is None else now - self._asked_at
        self._asked_at = now
        wanted = min(DELAY_MAX_S, max(DELAY_MIN_S, self._oldest.value + DELAY_SPARE_S))
        step = DELAY_RATE * min(0.1, max(0.0, elapsed))
        self._delay_s += min(step, max(-step, wanted - self._delay_s))


class _WindowedMaximum:
    """Maximum of the last one to two windows."""

    def __init__(self) -> None:
        self._now = self._before = 0.0
        self._until: float | None = None

    def add(self, at: float, value: float) -> None:
        if self._until is None or at >= self._until:
            self._before, self._now = self._now, value
            self._until = at + AGE_WINDOW_S
        self._now = max(self._now, value)

    @property
    def value(self) -> float:
        return max(self._now, self._before)
