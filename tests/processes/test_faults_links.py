"""Cuts and loss on the links of a live team, made at the receivers."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from lfa.deploy.bench.harness.team import Team
from lfa.deploy.bench.harness.team_history import REST_MPS
from lfa.protocol.names import robot_name
from lfa.protocol.topics import WORLD_NAME
from lfa.protocol.transport.link_model import LINK_CONDITIONS
from tests.rigs.live_team import ROBOTS, WHOLE_S, check_minority, check_terms, leads, pass_time, team

pytestmark = pytest.mark.processes

PARTED_S = 2.0


@pytest.fixture(scope="module")
def module_team() -> Iterator[Team]:
    with team() as live:
        yield live


@pytest.fixture
def live(module_team: Team) -> Iterator[Team]:
    module_team.await_chain(ROBOTS, WHOLE_S)
    module_team.heard.events.clear()
    yield module_team
    module_team.heal()
    check_terms(module_team)


@pytest.mark.parametrize("place", [2, 0], ids=["of followers", "with the leader"])
def test_l7_of_two_halves_the_one_without_the_witness_comes_to_rest(live: Team, place: int) -> None:
    """First of all: in a fresh team nobody is on the way to the tail, and who does not follow stands."""
    chain = live.await_chain(ROBOTS, WHOLE_S)
    side = chain[place : place + 2]
    others = [robot for robot in chain if robot not in side]
    since = live.cut_off(*side)
    if place == 0:
        live.wait_until(lambda: bool(set(leads(live, since)) & set(others)), "the other side does not lead", WHOLE_S)
    pass_time(live, PARTED_S)
    check_minority(live, side, others, led=place == 0)
    assert max(live.heard.speeds_mps[robot] for robot in others) > REST_MPS, "the witness's side does not drive"
    live.heal()
    live.await_chain(ROBOTS, WHOLE_S)
    assert not set(leads(live, since)) & set(side)


def test_a_leader_cut_off_is_replaced_and_comes_back_as_a_follower(live: Team) -> None:
    chain = live.await_chain(ROBOTS, WHOLE_S)
    since = live.cut_off(chain[0])
    live.wait_until(lambda: bool(set(leads(live, since)) & set(chain[1:])), "nobody else leads", WHOLE_S)
    live.heal()
    assert live.await_chain(ROBOTS, WHOLE_S)[0] != chain[0]


def test_a_leader_that_hears_nobody_is_replaced_although_all_hear_it(live: Team) -> None:
    chain = live.await_chain(ROBOTS, WHOLE_S)
    others = [*(robot_name(robot) for robot in chain[1:]), WORLD_NAME]
    since = live.order(LINK_CONDITIONS, cut=[(other, robot_name(chain[0])) for other in others])
    live.wait_until(lambda: bool(set(leads(live, since)) & set(chain[1:])), "nobody else leads", WHOLE_S)
    live.heal()
    live.await_chain(ROBOTS, WHOLE_S)


def test_two_followers_that_do_not_hear_each_other_change_no_leader(live: Team) -> None:
    chain = live.await_chain(ROBOTS, WHOLE_S)
    pair = robot_name(chain[2]), robot_name(chain[3])
    since = live.order(LINK_CONDITIONS, cut=[pair, pair[::-1]])
    pass_time(live, 1.0)
    live.heal()
    assert live.await_chain(ROBOTS, WHOLE_S)[0] == chain[0]
    assert leads(live, since) in ([], [chain[0]])


def test_a_tenth_of_all_messages_lost_changes_no_leader(live: Team) -> None:
    chain = live.await_chain(ROBOTS, WHOLE_S)
    since = live.order(LINK_CONDITIONS, radio={"loss": 0.1})
    pass_time(live, 3.0)
    assert leads(live, since) in ([], [chain[0]])
    live.heal()
