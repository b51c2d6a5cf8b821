"""`lfa bench soak`: how growth is judged, and a short form of it on real processes."""

from __future__ import annotations

import json
import os
from math import isnan

import pytest

from lfa.deploy.bench.soak.measure import growth, holding
from tests.rigs.lfa_runs import lfa


def test_growth_is_from_the_first_fifth_of_the_samples_to_the_last_by_their_medians() -> None:
    assert growth([100.0] * 10) == 0.0
    assert growth([100.0, 100.0, *[500.0] * 6, 103.0, 103.0]) == pytest.approx(3.0)
    assert growth([100.0]) == 0.0
    assert isnan(growth([]))


def test_a_process_of_this_machine_holds_memory_threads_and_descriptors() -> None:
    own = holding(os.getpid())
    assert own.memory_mib > 1.0
    assert own.threads >= 1.0
    assert own.descriptors >= 3.0


@pytest.mark.processes
def test_a_short_soak_violates_nothing_and_measures_what_lasts() -> None:
    done = lfa("bench", "soak", "--minutes", "0.1", "--json")
    rows = {row["name"]: row["value"] for row in json.loads(done.stdout)["rows"]}
    assert rows["soak/violations"] == 0.0, done.stderr
    assert rows["soak/faults"] >= 1.0
    assert {"growth/of unique memory, the largest", "growth/of threads, the largest"} < set(rows)
