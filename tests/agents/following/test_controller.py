"""The law's convergence as derived in control.md 2.1, on a drive without limits and with small steps."""

from __future__ import annotations

from math import atan, atan2, cos, exp, hypot, log, pi, sin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lfa.agents.config import DEFAULT, Gains
from lfa.agents.following.controller import Law, Reference
from lfa.agents.formation.slot_motion import SlotMotion
from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc, wrap
from lfa.protocol.messages.team import Slot
from lfa.protocol.mission import Limits

LIMITS = Limits()
DT = 0.0005
B, K = DEFAULT.b_m, DEFAULT.k_per_s


class Pair:
    """A predecessor, its slot, and a follower under the bare law."""

    def __init__(self, slot: Slot, predecessor: Pose2D, own: Pose2D, gains: Gains = DEFAULT) -> None:
        self.slot, self.predecessor, self.own = slot, predecessor, own
        self.motion = SlotMotion(gains, LIMITS, 0.0)
        self.motion.reset(slot, predecessor)
        self.law = Law(gains, LIMITS)
        self.law.reset(own, STILL)

    def step(self, twist: Twist) -> float:
        """Look-ahead error [m] before the step."""
        m = self.motion
        m.step(self.slot, self.predecessor, twist, DT)
        heading = atan2(m.vy, m.vx)
        error = self.look_ahead_error(self.law.heading)
        reference = Reference(
            m.x, m.y, m.vx, m.vy, heading, m.chi_rate, 1, self.predecessor, twist, m.separation_m, m.phi, False
        )  # fmt: skip
        command = self.law.step(reference, self.own, STILL, DT)
        self.predecessor = along_arc(self.predecessor, twist, DT)
        self.own = along_arc(self.own, command, DT)
        return error

    def look_ahead_error(self, desired: float) -> float:
        x = self.motion.x + B * cos(desired) - self.own.x - B * cos(self.own.theta)
        y = self.motion.y + B * sin(desired) - self.own.y - B * sin(self.own.theta)
        return hypot(x, y)


@settings(max_examples=40)
@given(
    phi=st.floats(pi / 2, 3 * pi / 2),
    start=st.tuples(st.floats(0.4, 1.0), st.floats(-pi, pi), st.floats(-1.0, 1.0)),
    wave=st.tuples(st.floats(-0.5, 1.0), st.floats(0.0, 0.4), st.floats(-1.0, 1.0), st.floats(0.0, 3.0)),
)
def test_the_look_ahead_error_decays_at_rate_K_within_2_percent(
    phi: float, start: tuple[float, float, float], wave: tuple[float, float, float, float]
) -> None:
    """2.1 (i): for any bounded predecessor motion and any heading, |e(t)| = |e(0)| exp(-K t)."""
    away, direction, heading = start
    slot = Slot(2, 1.2, phi)
    predecessor = Pose2D()
    own = Pose2D(1.2 * cos(phi) + away * cos(direction), 1.2 * sin(phi) + away * sin(direction), heading)
    gains = Gains(m_mps=10.0)
    pair = Pair(slot, predecessor, own, gains)
    mean, swing, turn, rate = wave
    errors = [pair.step(Twist(mean + swing * sin(rate * n * DT), turn * cos(rate * n * DT))) for n in range(3000)]
    for n in (800, 1600, 2999):
        decay = -log(errors[n] / errors[0]) / (n * DT)
        assert decay == pytest.approx(K, rel=0.02), f"after {n * DT} s of {wave}, phi {phi}, start {start}"


def test_saturated_feedback_closes_in_at_m_and_then_exponentially() -> None:
    """2.1 (iii): time from |e0| to eps is (|e0| - m/K)/m + ln(m/(K eps))/K."""
    pair = Pair(Slot(2, 1.2, pi), Pose2D(), Pose2D(-3.2, 0.0, 0.0))
    m, eps = DEFAULT.m_mps, 0.05
    expected = (2.0 - m / K) / m + log(m / (K * eps)) / K
    taken = 0.0
    while pair.step(Twist(0.5, 0.0)) > eps:
        taken += DT
    assert taken == pytest.approx(expected, abs=0.02)


def _heading_offset_after(delta: float, radius_m: float, seconds: float) -> float:
    """Heading error, unwrapped, `seconds` after it was `delta` with the look-ahead error zero, on a circle."""
    slot, twist = Slot(2, radius_m, pi / 2), Twist(1.0, 0.5 / radius_m)
    # A slot at the left, so that slot and centre of the circle are known: leader radius 2 R, slot radius R.
    pair = Pair(slot, Pose2D(2.0 * radius_m, 0.0, pi / 2), Pose2D(radius_m, 0.0, pi / 2))
    for _ in range(6000):
        pair.step(twist)
    heading = pair.law.heading
    theta = heading + delta
    m = pair.motion
    m.step(slot, pair.predecessor, twist, DT)
    pair.own = Pose2D(m.x + B * (cos(heading) - cos(theta)), m.y + B * (sin(heading) - sin(theta)), wrap(theta))
    offset = delta
    for _ in range(int(seconds / DT)):
        pair.step(twist)
        now = wrap(pair.own.theta - pair.law.heading)
        offset += wrap(now - offset)
    return offset


@pytest.mark.parametrize("radius_m", [0.3, 0.5, 1.0])
def test_the_heading_converges_from_inside_the_region_of_attraction_and_not_from_outside(radius_m: float) -> None:
    """2.1 (ii): |delta| < 2 atan(V_r / (b |psi_r'|)) = 2 atan(R / b); beyond it the robot turns the other way round."""
    edge = 2.0 * atan(radius_m / B)
    assert abs(_heading_offset_after(-(edge - 0.1), radius_m, 12.0)) < 0.02
    assert _heading_offset_after(-(edge + 0.1), radius_m, 12.0) == pytest.approx(-2.0 * pi, abs=0.02)


def test_the_heading_decays_at_V_over_b() -> None:
    """2.1 (ii): locally exponential with rate V_r / b."""
    start, seconds, radius_m = 0.05, 0.5, 4.0
    rest = _heading_offset_after(start, radius_m, seconds)
    assert rest == pytest.approx(start * exp(-0.5 / B * seconds), rel=0.05)
