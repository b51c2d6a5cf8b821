"""The offset of a sender's clock: nothing but the path's asymmetry is left."""

from __future__ import annotations

from random import Random

import pytest

from lfa.agents.localization.clock_offset import FUTURES_TO_RESET, ClockOffset

DAY = 86400.0
OFFSETS = (0.0, 3.0, -3.0, 10 * DAY, -10 * DAY)


def _talk(
    offset_s: float, drift: float, there_s: float, back_s: float, jitter_s: float, seconds: float = 40.0
) -> float:
    """Largest error [s] of the estimate against the true offset from 10 s on, messages at 50 Hz both ways."""
    ours, theirs, chance = ClockOffset(), ClockOffset(), Random(5)
    worst = 0.0
    for n in range(int(seconds * 50)):
        now = 1000.0 + n * 0.02
        peer = now * (1.0 + drift) - offset_s
        arrives = there_s + jitter_s * chance.random()
        ours.heard(peer, now + arrives)
        theirs.heard(now, peer + back_s + jitter_s * chance.random())
        if n % 25 == 0:
            ours.reported(theirs.least(peer), now)
        if n > 500:
            worst = max(worst, abs(ours.offset(now) - (now - peer)))
    return worst


@pytest.mark.parametrize("offset_s", OFFSETS)
@pytest.mark.parametrize("drift", [0.0, 200e-6, -200e-6])
def test_a_symmetric_path_leaves_no_error_whatever_offset_and_drift(offset_s: float, drift: float) -> None:
    assert _talk(offset_s, drift, 0.02, 0.02, 0.0) < 3e-5


@pytest.mark.parametrize("drift", [0.0, 200e-6, -200e-6])
def test_jitter_of_40_ms_costs_less_than_2_ms(drift: float) -> None:
    assert _talk(3.0, drift, 0.1, 0.1, 0.04) < 2e-3


def test_what_is_left_is_half_the_difference_of_the_two_ways() -> None:
    assert _talk(10 * DAY, 0.0, 0.03, 0.01, 0.0) == pytest.approx(0.01, abs=1e-6)


def test_without_a_report_the_offset_includes_the_least_latency() -> None:
    clock = ClockOffset()
    for n in range(100):
        clock.heard(n * 0.02 - 3.0, n * 0.02 + 0.015)
    assert clock.offset(2.0) == pytest.approx(3.015)


def test_a_stamp_from_the_future_is_refused_until_ten_in_a_row_agree() -> None:
    clock = ClockOffset()
    for n in range(100):
        assert clock.heard(n * 0.02, n * 0.02 + 0.001)
    assert not clock.heard(2.0 + 3600.0, 2.0)
    assert clock.offset(2.0) == pytest.approx(0.001)
    assert clock.heard(2.02, 2.021)
    taken = [clock.heard(3.0 + n * 0.02 + 60.0, 3.0 + n * 0.02) for n in range(FUTURES_TO_RESET)]
    assert taken == [False] * (FUTURES_TO_RESET - 1) + [True]
    assert clock.offset(4.0) == pytest.approx(-60.0)


def test_stamps_that_are_not_finite_and_own_time_running_backwards_are_refused() -> None:
    clock = ClockOffset()
    assert clock.heard(1.0, 1.0)
    for stamp, at in ((float("nan"), 2.0), (float("inf"), 2.0), (1.5, float("nan")), (0.5, 0.5)):
        assert not clock.heard(stamp, at)
    assert clock.offset(2.0) == 0.0
    assert clock.refused == 4
