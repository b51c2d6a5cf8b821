"""Which sets of voters decide. Pure arithmetic on configs (lease.md 3.1); no state, no time.

Dynamic linear voting: a majority, or exactly one half when the tie-breaker is in it. Two quorums of one electorate
always share a voter, and while a change is joint the previous electorate must agree too, so quorums of neighbouring
configs share one as well.
"""

from __future__ import annotations

from collections.abc import Container, Mapping

from protocol.messages import Config, Electorate, Member


def is_half(voters: tuple[Member, ...], tie: Member | None, present: Container[Member]) -> bool:
    """More than half of `voters`, or one half with the tie-breaker."""
    count = sum(voter in present for voter in voters)
    return 2 * count > len(voters) or (2 * count == len(voters) and tie is not None and tie in present)


def agrees(electorate: Electorate, present: Container[Member]) -> bool:
    """`present` decides for `electorate` by its own rule."""
    if electorate.rule == "all":
        return all(voter in present for voter in electorate.voters)
    return is_half(electorate.voters, electorate.tie, present)


def is_quorum(config: Config, present: Container[Member]) -> bool:
    """`present` decides for `config`: for its voters and, while it is joint, for the previous ones too."""
    if not is_half(config.voters, config.tie, present):
        return False
    return config.previous is None or agrees(config.previous, present)


def electors(config: Config) -> tuple[Member, ...]:
    """Everyone whose vote counts in `config`, each once, in a fixed order."""
    if config.previous is None:
        return config.voters
    return config.voters + tuple(m for m in config.previous.voters if m not in config.voters)


def quorum_time(config: Config, times: Mapping[Member, float]) -> float | None:
    """The latest t such that a quorum has `times` at or after t; None while no quorum has any."""
    newest_first = sorted(((times[m], m) for m in electors(config) if m in times), reverse=True)
    present: list[Member] = []
    for time, member in newest_first:
        present.append(member)
        if 2 * len(present) >= len(config.voters) and is_quorum(config, present):
            return time
    return None
