"""Partitions and resets between machines: each robot in its own network namespace with its own router."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from deploy.bench.team import Team
from protocol import clock
from tests.hosts.net import ROBOTS, WORLD_HOST, Net, missing, team_on_hosts
from tests.processes.live import WHOLE_S, check_terms, leads

WHY_NOT = missing()
pytestmark = [pytest.mark.hosts, pytest.mark.skipif(WHY_NOT is not None, reason=str(WHY_NOT))]

HEALED_S = 5.0
"""The issue's bound: from healing to one chain of all."""
PARTED_S = 3.0
REST_MPS = 1e-3


@pytest.fixture(scope="module")
def hosts() -> Iterator[tuple[Team, Net]]:
    with team_on_hosts() as made:
        yield made


@pytest.fixture
def whole(hosts: tuple[Team, Net]) -> Iterator[tuple[Team, Net, tuple[int, ...]]]:
    team, net = hosts
    chain = team.await_chain(ROBOTS, WHOLE_S)
    team.events.clear()
    yield team, net, chain
    net.heal()
    check_terms(team)


def test_of_two_halves_only_the_witness_side_drives_and_healing_makes_one_chain(
    whole: tuple[Team, Net, tuple[int, ...]],
) -> None:
    team, net, chain = whole
    since = clock.now()
    net.cut(chain[:2], (*chain[2:], WORLD_HOST))
    team.wait_until(lambda: bool(set(leads(team, since)) & set(chain[2:])), "the witness's side does not lead", WHOLE_S)
    parted = clock.now()
    _pass_time(team, PARTED_S)
    at_rest = {robot: team.speeds_mps[robot] for robot in chain[:2]}
    net.heal()
    healed = clock.now()
    team.wait_until(lambda: len(team.chain()) == ROBOTS, f"no chain of all: {team.describe()}", HEALED_S)
    assert max(at_rest.values()) < REST_MPS, f"moving without a quorum: {at_rest}"
    assert not set(leads(team, parted)) & set(chain[:2]), f"led after the cut: {leads(team, since)}"
    assert clock.now() - healed <= HEALED_S


def test_a_leader_alone_is_replaced_and_comes_back_as_a_follower(whole: tuple[Team, Net, tuple[int, ...]]) -> None:
    team, net, chain = whole
    since = clock.now()
    net.cut(chain[:1], (*chain[1:], WORLD_HOST))
    team.wait_until(lambda: bool(set(leads(team, since)) & set(chain[1:])), "nobody else leads", WHOLE_S)
    net.heal()
    assert team.await_chain(ROBOTS, WHOLE_S)[0] != chain[0]


def test_a_healthy_leader_whose_links_are_reset_never_makes_two_leaders(
    whole: tuple[Team, Net, tuple[int, ...]],
) -> None:
    team, net, chain = whole
    for _ in range(3):
        net.reset(chain[0])
        _pass_time(team, 0.1)
        net.heal()
        _pass_time(team, 0.5)
    team.await_chain(ROBOTS, WHOLE_S)


def test_the_world_alone_stops_everybody_and_nobody_leads_twice(whole: tuple[Team, Net, tuple[int, ...]]) -> None:
    team, net, chain = whole
    net.cut((WORLD_HOST,), chain)
    _pass_time(team, 2.0)
    since = clock.now()
    _pass_time(team, 0.5)
    assert leads(team, since) == []
    net.heal()
    team.await_chain(ROBOTS, WHOLE_S)


def _pass_time(team: Team, for_s: float) -> None:
    until = clock.now() + for_s
    team.wait_until(lambda: clock.now() >= until, "the clock stands")
