"""`lfa bench latency`: what it takes from journals, and raw UDP beside it."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfa.agents.config import CONTROL_PERIOD_S
from lfa.deploy.bench.latency import measure
from lfa.deploy.bench.latency.chain_times import Hop, ages_s, hops_of
from lfa.deploy.run import simulate
from lfa.protocol.errors import Refused
from lfa.world.description.load import draw, load
from lfa.world.simulator import LOCAL_DELAY_S

SEED = 7


def test_the_age_at_the_tail_is_that_of_the_leaders_pose_it_goes_back_to() -> None:
    first = [Hop(0.0, 0.1, 0.2, 0.3), Hop(1.0, 1.1, 1.2, 1.3)]
    second = [Hop(0.1, 0.15, 0.18, 0.2), Hop(0.2, 0.4, 0.5, 0.6), Hop(1.2, 1.4, 1.5, 1.6)]
    assert ages_s([first, second]) == pytest.approx([0.6, 0.6]), "the first command goes back to no pose of the leader"
    assert ages_s([first]) == pytest.approx([0.3, 0.3])


def test_the_hops_of_a_simulated_chain_have_the_delays_of_its_links(tmp_path: Path) -> None:
    drawn = draw(load("straight"), SEED)
    (tmp_path / "journal").mkdir()
    run = simulate.SimulatedRun(drawn, SEED, (), lambda *_: None, tmp_path / "journal")
    run.advance(2.0)
    run.close()
    hops = hops_of(tmp_path / "journal", (1, 2, 3, 4))
    assert [len(one) > 50 for one in hops] == [True, True, True]
    low = drawn.radio.delay_s + LOCAL_DELAY_S
    for hop in (hop for one in hops for hop in one if hop.step_at > 1.0):
        assert low - 1e-9 <= hop.latency_s <= low + drawn.radio.jitter_s + 1e-9
        assert 0.0 <= hop.wait_s <= CONTROL_PERIOD_S + drawn.radio.jitter_s


def test_rows_that_are_none_are_refused() -> None:
    with pytest.raises(Refused, match="they begin with chain of 4, chain of 10, kill of the leader"):
        measure.run(False, "chain of 5/*")
