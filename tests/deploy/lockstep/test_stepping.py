"""Speed and steps of a lockstep run: what the options mean, and what they refuse."""

from __future__ import annotations

from math import inf

import pytest

from lfa.deploy.lockstep.stepping import Pace, Stepping, pace_of
from lfa.protocol.errors import Refused


@pytest.mark.parametrize("speed", ["-1", "0", "nan", "inf", "fast"])
def test_a_speed_that_is_none_is_refused_in_one_line(speed: str) -> None:
    with pytest.raises(Refused, match=f"--speed {speed}: must be a number above 0") as refused:
        pace_of(speed, False, None)
    assert len(refused.value.lines) == 1


@pytest.mark.parametrize("step", ["0", "-3", "1.5", "many"])
def test_a_number_of_ticks_that_is_none_is_refused(step: str) -> None:
    with pytest.raises(Refused, match=f"--step {step}: must be a whole number of ticks"):
        pace_of(None, False, step)


def test_a_run_goes_on_without_end_as_fast_as_it_can_by_default() -> None:
    assert pace_of(None, False, None) == pace_of("max", False, None) == Pace(inf, None)
    assert Stepping(Pace(), 0.02).until == inf


def test_a_run_stands_at_its_start_or_after_its_steps_and_goes_on_from_there() -> None:
    assert Stepping(pace_of(None, True, None), 0.02).until == 0.0
    stepping = Stepping(pace_of(None, False, "50"), 0.02)
    assert stepping.until == pytest.approx(1.0)
    stepping.go_on(5)
    assert stepping.until == pytest.approx(1.1)
    stepping.go_on(None)
    assert stepping.until == inf
