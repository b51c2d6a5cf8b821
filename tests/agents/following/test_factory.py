"""Followers by mission: how far the formation's heading is filtered, and which distance the collision guard keeps."""

from __future__ import annotations

from math import pi

import pytest

from lfa.agents.following.factory import gains_of, heading_filter_of
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


@pytest.mark.parametrize(
    ("radius_m", "separation_m", "d_min_m"),
    [(0.15, 1.2, 0.45), (0.25, 0.8, 0.65), (0.333, 0.8, 0.7), (0.15, 0.5, 0.45)],
)
def test_the_collision_guard_keeps_bodies_apart_and_lets_each_follower_into_its_slot(
    radius_m: float, separation_m: float, d_min_m: float
) -> None:
    mission = Mission(robots=(1, 2), radius_m=radius_m, formation=FormationSpec(separation_m))
    assert gains_of(mission).d_min_m == pytest.approx(d_min_m)


def test_gains_that_a_mission_names_hold_as_they_are() -> None:
    mission = Mission(robots=(1, 2), radius_m=0.4, following=Following(gains={"d_min_m": 0.3}))
    assert gains_of(mission).d_min_m == 0.3
