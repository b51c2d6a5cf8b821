"""Partitions, loss, resets and lost routers: each robot in its own network namespace, with its own router.

nft parts hosts wholly; who alone does not hear whom is made at the receivers, since tcp would widen such a cut and
routers would heal it.
"""

from __future__ import annotations

import signal
from collections.abc import Iterator

import pytest

from lfa.deploy.bench.harness.team import Team
from lfa.deploy.bench.harness.team_history import REST_MPS
from lfa.protocol import clock
from lfa.protocol.names import robot_name
from lfa.protocol.topics import WORLD_NAME
from lfa.protocol.transport.link_model import LINK_CONDITIONS
from tests.hosts.conftest import Figure
from tests.rigs.live_team import WHOLE_S, check_minority, check_terms, leads, pass_time
from tests.rigs.network_namespaces import ROBOTS, WORLD_HOST, Net, missing, team_on_hosts

WHY_NOT = missing()
pytestmark = [pytest.mark.hosts, pytest.mark.skipif(WHY_NOT is not None, reason=str(WHY_NOT))]

Whole = tuple[Team, Net, tuple[int, ...]]
HEALED_S = 5.0
"""The issue's bound: from healing to one chain of all."""
PARTED_S = 3.0


@pytest.fixture(scope="module")
def hosts() -> Iterator[tuple[Team, Net]]:
    with team_on_hosts() as made:
        yield made


@pytest.fixture
def whole(hosts: tuple[Team, Net]) -> Iterator[Whole]:
    team, net = hosts
    chain = team.await_chain(ROBOTS, WHOLE_S)
    team.heard.events.clear()
    yield team, net, chain
    net.heal()
    team.heal()
    check_terms(team)


def test_l7_of_two_halves_only_the_witness_side_drives_and_healing_makes_one_chain(
    whole: Whole, figure: Figure
) -> None:
    team, net, chain = whole
    since = clock.now()
    net.cut(chain[:2], (*chain[2:], WORLD_HOST))
    team.wait_until(lambda: bool(set(leads(team, since)) & set(chain[2:])), "the witness's side does not lead", WHOLE_S)
    parted = clock.now()
    pass_time(team, PARTED_S)
    check_minority(team, chain[:2], chain[2:], led=True)
    assert max(team.heard.speeds_mps[robot] for robot in chain[2:]) > REST_MPS, "the witness's side does not drive"
    net.heal()
    healed = clock.now()
    team.wait_until(lambda: len(team.chain()) == ROBOTS, "no chain of all", WHOLE_S)
    figure("a 2|2 partition healed: one chain of four", clock.now() - healed, HEALED_S)
    assert not set(leads(team, parted)) & set(chain[:2]), f"led after the cut: {leads(team, since)}"


def test_a_leader_alone_is_replaced_and_comes_back_as_a_follower(whole: Whole) -> None:
    team, net, chain = whole
    since = clock.now()
    net.cut(chain[:1], (*chain[1:], WORLD_HOST))
    team.wait_until(lambda: bool(set(leads(team, since)) & set(chain[1:])), "nobody else leads", WHOLE_S)
    net.heal()
    assert team.await_chain(ROBOTS, WHOLE_S)[0] != chain[0]


@pytest.mark.parametrize("deaf", [True, False], ids=["hears nobody", "is heard by nobody"])
def test_a_leader_with_half_a_link_is_replaced(whole: Whole, deaf: bool) -> None:
    team, _, chain = whole
    others = [*(robot_name(robot) for robot in chain[1:]), WORLD_NAME]
    heard = [(other, robot_name(chain[0])) for other in others]
    since = team.order(LINK_CONDITIONS, cut=heard if deaf else [pair[::-1] for pair in heard])
    team.wait_until(lambda: bool(set(leads(team, since)) & set(chain[1:])), "nobody else leads", WHOLE_S)
    team.heal()
    team.await_chain(ROBOTS, WHOLE_S)


@pytest.mark.parametrize("place", [1, 2, None], ids=["next", "third", "witness"])
def test_a_leader_that_misses_one_voter_only_leads_on(whole: Whole, place: int | None) -> None:
    team, _, chain = whole
    pair = robot_name(chain[0]), WORLD_NAME if place is None else robot_name(chain[place])
    since = team.order(LINK_CONDITIONS, cut=[pair, pair[::-1]])
    pass_time(team, 1.5)
    assert leads(team, since) in ([], [chain[0]])
    team.heal()
    assert team.await_chain(ROBOTS, WHOLE_S)[0] == chain[0]


def test_a_healthy_leader_whose_links_are_reset_never_makes_two_leaders(whole: Whole) -> None:
    team, net, chain = whole
    for _ in range(3):
        net.reset(chain[0])
        pass_time(team, 0.1)
        net.heal()
        pass_time(team, 0.5)
    team.await_chain(ROBOTS, WHOLE_S)


@pytest.mark.parametrize("percent", [10, 30])
def test_lost_messages_and_lost_packets_never_make_two_leaders(whole: Whole, percent: int) -> None:
    team, net, _ = whole
    team.order(LINK_CONDITIONS, radio={"loss": percent / 100.0, "loss_burst": 3.0})
    pass_time(team, 2.0)
    team.heal()
    net.lose(percent)
    pass_time(team, 2.0)
    net.heal()
    team.await_chain(ROBOTS, WHOLE_S)


def test_a_robot_whose_router_dies_leaves_the_chain_and_returns_with_it(whole: Whole) -> None:
    team, _, chain = whole
    router = f"router{chain[0]}"
    since = team.signal(router, signal.SIGKILL)
    team.wait_until(lambda: bool(set(leads(team, since)) & set(chain[1:])), "nobody else leads", WHOLE_S)
    team.restart(router)
    assert sorted(team.await_chain(ROBOTS, WHOLE_S)) == sorted(chain)


def test_the_world_alone_stops_everybody_and_nobody_leads_twice(whole: Whole) -> None:
    team, net, chain = whole
    net.cut((WORLD_HOST,), chain)
    pass_time(team, 2.0)
    since = clock.now()
    pass_time(team, 0.5)
    assert leads(team, since) == []
    net.heal()
    team.await_chain(ROBOTS, WHOLE_S)


def test_the_journals_of_all_this_break_no_invariant(whole: Whole) -> None:
    assert whole[0].judged().broken == ()
