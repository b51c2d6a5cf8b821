"""`lfa bench agents`: which teams it measures, with which bars, and how it reads a process's memory."""

from __future__ import annotations

import os

import pytest

from lfa.deploy.bench.agents import teams
from lfa.deploy.bench.agents.footprint import footprint, footprint_of

ROLLUP = """55d0-7ffe ---p 00000000 00:00 0    [rollup]
Rss:               30720 kB
Pss:               12000 kB
Shared_Clean:      20000 kB
Private_Clean:      1024 kB
Private_Dirty:      9216 kB
"""


def test_each_team_has_the_bars_of_its_rate() -> None:
    bars = {case.name: case.quantities[0].bar for case in teams.cases(teams.SIZES_FULL)}
    assert bars == {
        "4 robots at 50 Hz": 3.5,
        "4 robots at 20 Hz": 1.3,
        "20 robots at 20 Hz": 1.3,
        "50 robots at 20 Hz": 1.3,
        "100 robots at 20 Hz": 1.3,
    }


def test_unique_memory_is_what_no_other_process_shares() -> None:
    found = footprint_of(ROLLUP, threads=8)
    assert (found.resident_mib, found.unique_mib, found.threads) == (30.0, 10.0, 8)


def test_a_process_of_this_machine_has_a_footprint() -> None:
    own = footprint(os.getpid())
    assert own.resident_mib > own.unique_mib > 1.0
    assert own.threads >= 1


@pytest.mark.parametrize(("values", "p99"), [([1.0], 1.0), (list(range(100)), 99.0), (list(range(200)), 198.0)])
def test_the_99th_percentile_leaves_out_the_largest_hundredth(values: list[float], p99: float) -> None:
    assert teams._p99(values) == p99
