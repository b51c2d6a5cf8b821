"""A term that a robot made up, with its own keys, is not the last one of its team (E26)."""

from __future__ import annotations

import pytest

from lfa.protocol.lease.gateway import Gateway
from lfa.protocol.lease.machine.lease import Lease
from lfa.protocol.lease.term_window import BURST, FREE, FRESH, RATE_HZ, TermWindow
from lfa.protocol.messages.consensus import (
    NO_TERM,
    Fence,
    Fenced,
    LeaseBody,
    Member,
    Nack,
    Prepare,
    Release,
    Term,
    Version,
)
from tests.rigs.lease_scenes import OLD, STD, TEAM, Team

LAST = 2**53


def poison(team: Team, number: int) -> None:
    """Robot 3 says PREPARE, NACK and RELEASE to all processes and FENCE to all gateways, with a term of that number."""
    term, source = Term(number, 3, 1), team.processes[3].member
    agreed = team.lease_of(3).agreed
    said: tuple[LeaseBody, ...] = (
        Prepare(term, Version(), agreed=agreed),
        Prepare(term, Version(term, 0), agreed=agreed),
        Nack(team.lease_of(1).term, term, None, 0.0, OLD),
        Release(term),
    )
    for process in team.processes.values():
        for body in said if process.alive and process.id != 3 else ():
            team.deliver(process, process.lease.receive, (source, body))
    for robot_id in team.gateways:
        team.fence(robot_id, Fence(term, term))


def drives(team: Team, until: float) -> bool:
    """The team runs on; its commands are obeyed in the last half second before `until` [s], in terms that fit."""
    team.run(until)
    last = [cmd for at, cmd in team.accepted if at > until - 0.5]
    return bool(last) and last[-1].term.n <= LAST


@pytest.mark.parametrize("number", [LAST, LAST - 1, FREE + FRESH + 1, FREE, FREE - 1])
def test_e26_a_made_up_term_stops_no_team(number: int) -> None:
    team = Team()
    poison(team, number)
    assert drives(team, 3.0)
    team.kill(1)
    assert drives(team, 6.0), "the next leader's term comes after it, too"
    assert team.leaders() == [2]
    team.start(1)
    team.run(8.0)
    assert 1 in team.lease_of(2).chain, "who comes back without memory believes the team"
    assert team.safe()


def test_e26_a_robot_that_goes_on_making_up_terms_stops_no_team() -> None:
    team, number = Team(), FREE
    while team.now < 4.0:
        poison(team, number)
        number += 500
        team.run(team.now + 0.1)
    assert drives(team, 5.0)


def test_e26_without_a_leader_the_last_term_wins_no_promise() -> None:
    lease = Lease(Member(2, 1), TEAM, STD, 0.0, floor=0)
    lease.tick(1.0)
    assert lease.receive(Member(3, 1), Prepare(Term(LAST, 3, 1), Version(), agreed=lease.agreed), 1.0) == []


def test_e26_a_gateway_believes_no_fence_of_the_last_term_and_confirms_no_old_one() -> None:
    gateway = Gateway(1, 5, STD, 0.0)
    now_ms = Term(1_800_000_000_000, 2, 7)
    assert gateway.fence(Fence(NO_TERM, now_ms), 1.0) == Fenced(NO_TERM, now_ms), "a wall clock is believed at once"
    assert gateway.fence(Fence(now_ms, Term(LAST, 3, 1)), 2.0) == Fenced(NO_TERM, now_ms)
    assert gateway.term_max == now_ms


def test_e26_a_gateway_that_names_the_last_term_leaves_its_leader_and_its_followers_as_they_are() -> None:
    team = Team()
    team.run(2.0)
    for robot in (1, 3):
        process = team.processes[robot]
        team.deliver(process, process.lease.gateway_term, (Term(LAST, 3, 1),))
    assert drives(team, 4.0)
    assert team.leaders() == [1]


def test_e26_above_the_free_numbers_terms_grow_no_faster_than_elections_do() -> None:
    window = TermWindow()
    assert window.believes(FREE, 10.0)
    assert window.believes(FREE + BURST, 10.0)
    assert not window.believes(FREE + BURST + 1, 10.0)
    assert window.believes(FREE + BURST + int(RATE_HZ), 11.0)
    assert not window.believes(FREE + BURST + int(RATE_HZ) + 1, 11.0)


def test_e26_a_wall_clock_of_any_year_is_no_floor_above_the_free_numbers() -> None:
    lease = Lease(Member(1, 1), TEAM, STD, 0.0, floor=LAST)
    other = TermWindow()
    assert other.believes(lease.term.n, 0.0)
    prepare = next(e.body for e in lease.tick(STD.grant_s) if isinstance(getattr(e, "body", None), Prepare))  # type: ignore[union-attr]
    assert other.believes(prepare.term.n, 1.0)
