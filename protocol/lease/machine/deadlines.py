"""Deadlines of one process by name: the one list that `tick` and `next_deadline` read.

A deadline has two times [s], both on the process's own clock: from the first on, a tick does what is due; for the
second, the process is woken. They differ where waiting costs nothing. A process that ticks at `again_at` anyway is not
woken shortly before for a round, which it sends a tick early instead where the one after that can wait for a tick, too:
else rounds would come twice as often as they need; nor for a HELLO that it does not need to send; an attempt that is
asked for again within half a heartbeat is given up then.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from lfa.protocol.lease.machine.memory import LeaseMemory
from lfa.protocol.lease.machine.table import ACTIONS, LeaseEvent, LeaseState

NEVER = float("inf")
LATE_S = 1e-3
"""Tolerance [s]: a round due at most this long before the next tick waits until that tick."""

When = Callable[[LeaseMemory, float], float]


class Deadline(NamedTuple):
    """One thing that a process does when its time comes: the event that it fires, and when."""

    event: LeaseEvent
    due: When
    """Time [s] from which a tick fires the event, given the memory and the time of the next tick."""
    wakes: When
    """Time [s] at which the process is woken for the event."""


def expiry(m: LeaseMemory, _again_at: float = NEVER) -> float:
    """Return the expiry [s] of the lease held; -inf before a quorum has granted it."""
    return -NEVER if m.holder is None or m.holder.expiry is None else m.holder.expiry


def _release(m: LeaseMemory, _again_at: float) -> float:
    return m.pending_release.release_at


def _round(m: LeaseMemory, again_at: float) -> float:
    if m.holder is None:
        return NEVER
    at, latest_at = m.holder.next_round_at, again_at - LATE_S
    return min(at, latest_at - m.holder.timing.heartbeat_s) if at <= latest_at else at


def _round_wakes(m: LeaseMemory, again_at: float) -> float:
    at = NEVER if m.holder is None else m.holder.next_round_at
    return NEVER if again_at - LATE_S <= at < again_at else at


def _election(m: LeaseMemory, _again_at: float) -> float:
    return m.election.at


def _gives_up(m: LeaseMemory, _again_at: float) -> float:
    return NEVER if m.candidate is None else m.candidate.gives_up_at


def _gives_up_wakes(m: LeaseMemory, _again_at: float) -> float:
    return m.candidate.gives_up_at if m.candidate is not None and m.candidate.transferred else NEVER


def _ask_grants(m: LeaseMemory, _again_at: float) -> float:
    asked = None if m.candidate is None else m.candidate.holder
    return NEVER if asked is None else asked.next_round_at


def _forget(m: LeaseMemory, _again_at: float) -> float:
    return m.election.forget_until if m.candidate is not None and m.candidate.forget else NEVER


def _ask_promises(m: LeaseMemory, _again_at: float) -> float:
    return NEVER if m.candidate is None else m.candidate.ask_at


def _hello(m: LeaseMemory, _again_at: float) -> float:
    return m.hello_at


def _hello_wakes(m: LeaseMemory, again_at: float) -> float:
    needed = m.hello_at >= again_at or m.candidate is not None or m.is_out(m.hello_at)
    return m.hello_at if needed else NEVER


def _leader_lost(m: LeaseMemory, _again_at: float) -> float:
    return NEVER if m.leader is None else m.leader_until


def _never(_m: LeaseMemory, _again_at: float) -> float:
    return NEVER


# fmt: off
DEADLINES = (
    #        fires                             from           wakes at
    Deadline(LeaseEvent.LEASE_EXPIRED,         expiry,        expiry),
    Deadline(LeaseEvent.RELEASE_DUE,           _release,      _release),
    Deadline(LeaseEvent.CONFIG_DUE,            _round,        _round_wakes),
    Deadline(LeaseEvent.ROUND_DUE,             _round,        _round_wakes),
    Deadline(LeaseEvent.ELECTION_DUE,          _election,     _election),
    Deadline(LeaseEvent.ATTEMPT_OVER,          _gives_up,     _gives_up_wakes),
    Deadline(LeaseEvent.GRANTS_DUE,            _ask_grants,   _ask_grants),
    Deadline(LeaseEvent.FORGET_OVER,           _forget,       _never),
    Deadline(LeaseEvent.PROMISES_DUE,          _ask_promises, _ask_promises),
    Deadline(LeaseEvent.HELLO_DUE,             _hello,        _hello_wakes),
    Deadline(LeaseEvent.LEADER_LOST,           _leader_lost,  _leader_lost),
)
"""In the order in which a tick does what is due."""
# fmt: on


def wakes_by_state(deadlines: tuple[Deadline, ...]) -> dict[LeaseState, tuple[When, ...]]:
    """Return for each state the wake-up times of the events that do something in it."""
    return {
        state: tuple(deadline.wakes for deadline in deadlines if (deadline.event, state) in ACTIONS)
        for state in LeaseState
    }


def dues_by_state(deadlines: tuple[Deadline, ...]) -> dict[LeaseState, tuple[When | None, ...]]:
    """Return for each state the time of each deadline in their order; None where its event does nothing in it."""
    return {
        state: tuple(deadline.due if (deadline.event, state) in ACTIONS else None for deadline in deadlines)
        for state in LeaseState
    }


WAKES = wakes_by_state(DEADLINES)
"""What `next_deadline` asks, several hundred times a second."""
DUES = dues_by_state(DEADLINES)
"""What `tick` asks."""
