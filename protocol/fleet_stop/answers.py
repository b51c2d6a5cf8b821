"""Answers of one gateway to the orders of an operator, and its word that the wheels rest."""

from __future__ import annotations

from lfa.protocol.fleet_stop.latch import StopLatch
from lfa.protocol.geometry import Twist
from lfa.protocol.messages.stop import StopState
from lfa.protocol.node import Envelope
from lfa.protocol.outbox import Outbox

REST_MPS, REST_RADPS = 0.01, 0.03
"""Measured speeds below which wheels count as at rest: more than the noise of an odometry."""


class StopAnswers:
    """Sender of `stop_state` on the robot's key of `outbox`; twists are measured, `now` is the gateway's time [s]."""

    def __init__(self, outbox: Outbox) -> None:
        self._outbox = outbox
        self._reported_rest = True

    def answer(self, latch: StopLatch, twist: Twist, now: float) -> Envelope:
        """Return the answer to an order."""
        rests = _rests(twist)
        self._reported_rest = rests or not latch.known.word.stand
        state = StopState(self._outbox.header("stop_state", now), latch.known, rests, latch.kept)
        return self._outbox.envelope("stop_state", state)

    def at_rest(self, latch: StopLatch, twist: Twist, now: float) -> Envelope | None:
        """Return the message that the wheels have come to rest after an answer that said otherwise, once; else None."""
        if self._reported_rest or not _rests(twist):
            return None
        return self.answer(latch, twist, now)


def _rests(twist: Twist) -> bool:
    return abs(twist.linear_x) < REST_MPS and abs(twist.angular_z) < REST_RADPS
