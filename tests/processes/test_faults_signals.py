"""Signals to agents of a live team: killed, terminated, stopped and woken; one, several, all; and back again."""

from __future__ import annotations

import signal
from collections.abc import Iterator

import pytest

from lfa.deploy.bench.harness.team import Team
from lfa.protocol import clock
from tests.rigs.live_team import ROBOTS, WHOLE_S, check_terms, leads, team

pytestmark = pytest.mark.processes


@pytest.fixture(scope="module")
def module_team() -> Iterator[Team]:
    with team() as live:
        yield live


@pytest.fixture
def live(module_team: Team) -> Iterator[Team]:
    module_team.await_chain(ROBOTS, WHOLE_S)
    module_team.heard.events.clear()
    yield module_team
    check_terms(module_team)


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
@pytest.mark.parametrize("place", [0, 1, 3], ids=["leader", "middle", "tail"])
def test_the_chain_closes_over_one_that_ends_and_it_returns_at_the_tail(
    live: Team, place: int, number: signal.Signals
) -> None:
    chain = live.await_chain(ROBOTS, WHOLE_S)
    victim, rest = chain[place], chain[:place] + chain[place + 1 :]
    live.signal(victim, number)
    assert live.await_chain(ROBOTS - 1, WHOLE_S) == rest
    live.restart(victim)
    assert live.await_chain(ROBOTS, WHOLE_S) == (*rest, victim)


def test_one_that_starts_again_at_once_is_a_new_member_at_the_tail(live: Team) -> None:
    chain = live.await_chain(ROBOTS, WHOLE_S)
    live.signal(chain[1], signal.SIGKILL)
    live.restart(chain[1])
    live.wait_until(lambda: live.chain() == (chain[0], *chain[2:], chain[1]), "it is not at the tail", WHOLE_S)


def test_a_short_stop_of_the_leader_changes_nothing(live: Team) -> None:
    chain = live.await_chain(ROBOTS, WHOLE_S)
    since = live.signal(chain[0], signal.SIGSTOP)
    _pass_time(live, 0.05)
    live.signal(chain[0], signal.SIGCONT)
    _pass_time(live, 0.6)
    assert live.await_chain(ROBOTS, WHOLE_S) == chain
    assert leads(live, since) in ([], [chain[0]])


@pytest.mark.parametrize("for_s", [0.6, 2.5], ids=["below the link lease", "beyond the link lease"])
def test_a_leader_that_wakes_up_late_finds_another_and_leads_no_more(live: Team, for_s: float) -> None:
    chain = live.await_chain(ROBOTS, WHOLE_S)
    since = live.signal(chain[0], signal.SIGSTOP)
    live.wait_until(lambda: bool(set(leads(live, since)) & set(chain[1:])), "nobody else leads", WHOLE_S)
    _pass_time(live, max(0.0, since + for_s - clock.now()))
    live.signal(chain[0], signal.SIGCONT)
    assert live.await_chain(ROBOTS, WHOLE_S)[0] != chain[0]
    assert chain[0] not in leads(live, since)


def test_the_leader_and_the_next_killed_at_once_leave_the_third_to_lead(live: Team) -> None:
    chain = live.await_chain(ROBOTS, WHOLE_S)
    for victim in chain[:2]:
        live.signal(victim, signal.SIGKILL)
    assert live.await_chain(ROBOTS - 2, WHOLE_S) == chain[2:]
    live.restart(*chain[:2])
    assert live.await_chain(ROBOTS, WHOLE_S)[:2] == chain[2:]


def test_all_killed_at_once_and_started_again_make_one_chain(live: Team) -> None:
    chain = live.await_chain(ROBOTS, WHOLE_S)
    for victim in chain:
        live.signal(victim, signal.SIGKILL)
    live.restart(*chain)
    assert sorted(live.await_chain(ROBOTS, WHOLE_S)) == sorted(chain)


def _pass_time(live: Team, for_s: float) -> None:
    until = clock.now() + for_s
    live.wait_until(lambda: clock.now() >= until, "the clock stands")
