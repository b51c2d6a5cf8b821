"""`lfa bench sim`: its bars, what it measures, and the exponent that it prints."""

from __future__ import annotations

import pytest

from lfa.deploy.bench.sim.speed import CASES_FULL, SpeedCase, chosen_by, cost_of, exponent
from lfa.protocol.errors import Refused


def test_the_bars_are_those_of_four_twenty_a_hundred_and_a_thousand_robots() -> None:
    assert {case.name: case.times_min for case in CASES_FULL if case.times_min} == {
        "4 robots at 50 Hz": 30.0,
        "20 robots at 50 Hz": 5.0,
        "100 robots at 20 Hz": 2.0,
        "1000 robots without lidar at 10 Hz": 0.5,
    }


@pytest.mark.parametrize(
    ("rows", "names", "growth"),
    [
        ("1000*", ["1000 robots without lidar at 10 Hz"], False),
        ("200 *", ["200 robots without lidar at 10 Hz"], False),
        ("4 robots*/times real time", ["4 robots at 50 Hz"], False),
        ("growth/*", ["20 robots at 20 Hz", "50 robots at 20 Hz", "100 robots at 20 Hz"], True),
        ("*", [case.name for case in CASES_FULL], True),
    ],
)
def test_only_the_teams_of_the_rows_asked_for_are_measured(rows: str, names: list[str], growth: bool) -> None:
    asked, chosen = chosen_by(rows, CASES_FULL)
    assert (asked, [case.name for case in chosen]) == (growth, names)


def test_rows_that_no_team_has_are_refused() -> None:
    with pytest.raises(Refused, match="--rows '3 robots\\*': no row has such a name"):
        chosen_by("3 robots*")
    with pytest.raises(Refused, match="no row has such a name"):
        chosen_by("1000*")  # only with --full


@pytest.mark.parametrize("power", [1.0, 1.5, 2.0])
def test_the_exponent_of_a_power_is_that_power(power: float) -> None:
    assert exponent({robots: 0.3 * robots**power for robots in (20, 50, 100)}) == pytest.approx(power)


def test_a_run_costs_more_than_its_messages() -> None:
    cost = cost_of(SpeedCase(2, 10.0, 1.5, beams=0))
    assert cost.run_s > cost.messages_s > 0.0


def test_a_team_below_its_bar_says_where_its_time_goes() -> None:
    shares = cost_of(SpeedCase(2, 20.0, 1.2, times_min=1e6, profiled_s=0.2)).shares
    assert sum(shares.values()) == pytest.approx(100.0)
    assert list(shares.values()) == sorted(shares.values(), reverse=True)
    assert {"protocol/lease", "deploy/recording", "agents/following"} < shares.keys()
