"""Quorum rules: pure arithmetic on configs (lease.md 3.1), without state and time.

Dynamic linear voting: a majority, or exactly one half if it contains the tie-breaker. Two quorums of one electorate
always share a voter, and while a change is joint the previous electorate must agree too, so quorums of neighbouring
configs share one as well.
"""

from __future__ import annotations

from collections.abc import Container, Mapping

from lfa.protocol.messages.consensus import Config, Electorate, Member

NEVER = float("-inf")


def is_half(voters: tuple[Member, ...], tie: Member | None, present: Container[Member]) -> bool:
    """Return True if `present` has more than half of `voters`, or one half with the tie-breaker."""
    count = 0
    for voter in voters:
        count += voter in present
    return 2 * count > len(voters) or (2 * count == len(voters) and tie is not None and tie in present)


def agrees(electorate: Electorate, present: Container[Member]) -> bool:
    """Return True if `present` is a quorum of `electorate` by its own rule."""
    if electorate.rule == "all":
        return all(voter in present for voter in electorate.voters)
    return is_half(electorate.voters, electorate.tie, present)


def is_quorum(config: Config, present: Container[Member]) -> bool:
    """Return True if `present` is a quorum of the voters of `config` and, while joint, of the previous ones too."""
    if not is_half(config.voters, config.tie, present):
        return False
    return config.previous is None or agrees(config.previous, present)


def electors(config: Config) -> tuple[Member, ...]:
    """Return all members whose vote counts in `config`, each once, in a fixed order."""
    if config.previous is None:
        return config.voters
    return config.voters + tuple(m for m in config.previous.voters if m not in config.voters)


def quorum_time(config: Config, times: Mapping[Member, float]) -> float | None:
    """Return the latest t [s] such that a quorum has `times` at or after t; None if no quorum has times."""
    time = _half_time(config.voters, config.tie, times)
    previous = config.previous
    if previous is not None:
        before = (
            min((times.get(m, NEVER) for m in previous.voters), default=NEVER)
            if previous.rule == "all"
            else _half_time(previous.voters, previous.tie, times)
        )
        time = min(time, before)
    return None if time == NEVER else time


def _half_time(voters: tuple[Member, ...], tie: Member | None, times: Mapping[Member, float]) -> float:
    """Return the latest time [s] reached by enough voters for `is_half`; NEVER if there is none."""
    if not voters:
        return NEVER
    newest_first = sorted([times.get(m, NEVER) for m in voters], reverse=True)
    half, odd = divmod(len(voters), 2)
    time = newest_first[half]
    if not odd and tie is not None:
        time = max(time, min(newest_first[half - 1], times.get(tie, NEVER)))
    return time
