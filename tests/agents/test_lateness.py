"""A robot whose loop is late for seconds says so, and that it keeps time again; one late second is nothing."""

from __future__ import annotations

from lfa.protocol.runtime.lateness import LATE_SECONDS, Lateness

TOO_MUCH_S = 0.04


def changes(*lags_s: float) -> list[bool]:
    """Return after each second whether the loop counts as late, where that changed."""
    lateness = Lateness(TOO_MUCH_S)
    return [lateness.worst_s > 0.0 for lag_s in lags_s if lateness.update(lag_s)]


def test_one_pause_of_the_machine_is_no_overload() -> None:
    assert changes(0.001, 0.5, 0.001, 0.001, 0.6, 0.002) == []


def test_seconds_of_lateness_are_told_once_and_their_end_too() -> None:
    assert changes(*[0.1] * 6, *[0.001] * 6) == [True, False]


def test_the_text_has_the_largest_lateness() -> None:
    lateness = Lateness(TOO_MUCH_S)
    assert lateness.text() == ""
    for lag_s in (0.05, 0.23, 0.05)[:LATE_SECONDS]:
        lateness.update(lag_s)
    assert lateness.text() == "late: by up to 230 ms, the machine is too busy"
