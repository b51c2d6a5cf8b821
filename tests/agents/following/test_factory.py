"""Followers by mission: how far the formation's heading is filtered, by the length of the chain."""

from __future__ import annotations

from math import pi

import pytest

from lfa.agents.following.factory import heading_filter_of
from lfa.protocol.mission import Following, FormationSpec, Mission


@pytest.mark.parametrize(
    ("robots", "side", "given_m", "filter_m"),
    [
        (4, "left", 0.0, 0.0),
        (5, "left", 0.0, 0.6),
        (5, "right", 0.0, 0.6),
        (12, "column", 0.0, 1.2),
        (12, "left", 0.1, 0.1),
        (3, "left", 0.36, 0.36),
    ],
)
def test_a_chain_of_more_than_three_followers_is_not_rigid(
    robots: int, side: str, given_m: float, filter_m: float
) -> None:
    spec = FormationSpec(2.0, pi / 3, side, given_m)  # type: ignore[arg-type]
    mission = Mission(robots=tuple(range(1, robots + 1)), formation=spec)
    assert heading_filter_of(mission) == pytest.approx(filter_m)


def test_on_a_trace_there_is_nothing_to_filter() -> None:
    mission = Mission(robots=tuple(range(1, 13)), following=Following(trace=True))
    assert heading_filter_of(mission) == 0.0
