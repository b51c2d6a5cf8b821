"""A live team that the tests of one file share: each begins with all four in one chain, and leaves it so."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from deploy.bench.team import Team, endless
from protocol.messages import Event, Term

ROBOTS = 4
WHOLE_S = 15.0
"""Patience for a team to be whole again, on a machine that may be busy."""


@contextmanager
def team() -> Iterator[Team]:
    with Team(endless(ROBOTS)) as live:
        live.await_chain(ROBOTS, WHOLE_S)
        yield live


def leads(live: Team, since: float) -> list[int]:
    """Whose leader commands gateways accepted since then: each change once."""
    robots = [e.data["robot"] for e in _commands(live) if e.header.stamp >= since]
    return [robot for n, robot in enumerate(robots) if n == 0 or robots[n - 1] != robot]


def check_terms(live: Team) -> None:
    """I2, seen from outside: over all gateways, leader commands never go back to an older term."""
    newest = Term()
    for event in _commands(live):
        assert event.term is not None and event.term >= newest, (
            f"robot {event.data['robot']} was obeyed as leader of {event.term} after {newest}"
        )
        newest = event.term


def _commands(live: Team) -> list[Event]:
    return sorted((e for e in live.events if e.kind == "leader_command"), key=lambda e: e.header.stamp)
