"""The table of the lease's states and transitions is the machine: what happens stands in it, and all of it happens."""

from __future__ import annotations

from collections import Counter
from functools import cache
from itertools import product
from unittest.mock import patch

import pytest

from lfa.deploy.fuzz.fault_injector import play
from lfa.deploy.fuzz.lease_simulation import LeaseSimulation
from lfa.deploy.fuzz.schedules import draw
from lfa.protocol.lease.machine.deadlines import DEADLINES
from lfa.protocol.lease.machine.lease import EVENTS, Observed
from lfa.protocol.lease.machine.table import ACTIONS, TRANSITIONS, LeaseEvent, LeaseState, Transition
from lfa.protocol.messages.consensus import Member
from tests.protocol.lease import page

SEEDS = 40
IN_NO_SCHEDULE = {
    (LeaseEvent.FORGET, LeaseState.FOLLOWER),  # an operator's word: test_forget.py
    (LeaseEvent.FORGET_OVER, LeaseState.CANDIDATE),
    (LeaseEvent.NACK_NEWER, LeaseState.PROPOSING),  # in 200 schedules none met a newer config there: promises tell it
    (LeaseEvent.NACK_NEWER, LeaseState.LEADER),
    (LeaseEvent.NACK_BOTH, LeaseState.LEADER),
}
"""Event and first state of the rows that random schedules do not reach."""


@cache
def observed() -> Counter[tuple[LeaseEvent, LeaseState, LeaseState]]:
    """How often each event led from which state to which, over schedules of faults."""
    seen: Counter[tuple[LeaseEvent, LeaseState, LeaseState]] = Counter()

    def see(_: LeaseSimulation, _who: Member, step: Observed) -> None:
        seen[step.event, step.before, step.after] += 1

    with patch.object(LeaseSimulation, "observed", see):
        for seed in range(SEEDS):
            play(draw(seed))
    return seen


def test_the_page_shows_the_table() -> None:
    assert page.on_page() == page.text(), "make pages"


def test_in_each_state_an_event_causes_one_action() -> None:
    pairs = Counter(pair for row in TRANSITIONS for pair in product([row.event], row.states))
    assert not [pair for pair, n in pairs.items() if n > 1]
    assert {row.event for row in TRANSITIONS} == set(LeaseEvent)


def test_every_deadline_and_every_message_has_a_row() -> None:
    assert {d.event for d in DEADLINES} | set(EVENTS.values()) <= {row.event for row in TRANSITIONS}


def test_no_process_gets_where_the_table_does_not_let_it() -> None:
    allowed = {(row.event, state): {*row.to, state} for row in TRANSITIONS for state in row.states}
    astray = [
        f"{event}: {before} -> {after}, {n} times"
        for (event, before, after), n in observed().items()
        if after not in allowed.get((event, before), {before})
    ]
    assert not astray, "\n".join(astray)


ALIVE = [row for row in TRANSITIONS if (row.event, row.states[0]) not in IN_NO_SCHEDULE]


@pytest.mark.parametrize("row", ALIVE, ids=lambda row: f"{row.event}-{row.states[0]}")
def test_no_row_is_dead(row: Transition) -> None:
    assert any(observed()[row.event, before, after] for before in row.states for after in LeaseState), "in no schedule"


def test_an_event_without_a_row_changes_nothing() -> None:
    moved = [key for key in observed() if key[:2] not in ACTIONS and key[1] != key[2]]
    assert not moved
