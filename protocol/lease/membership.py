"""Configs: the first one, and changes of voters and chain. Pure functions; `lease.py` decides who may write a config.

Every change keeps the order of the chain: dead robots leave it, returning robots join at the tail (E9). Voters change
jointly (E17): the new config needs quorums of both electorates, until both have accepted it.
"""

from __future__ import annotations

from collections.abc import Callable

from lfa.protocol.messages.consensus import NO_TERM, Config, Electorate, Member, Term, Version
from lfa.protocol.mission import Mission
from lfa.protocol.names import WITNESS_ID

VOTERS_MAX = 7
"""Maximum number of voters: lease traffic grows with the voters, not with the team; further robots only learn."""
ANY_LIFE = 0
"""Incarnation in the first config, which no leader wrote: it names no real incarnation, so no process votes in it."""

Gone = Callable[[Member], bool]


def first_config(mission: Mission) -> Config:
    """Return the config of a process that has heard no other: the mission's order, without voters."""
    return Config(Version(NO_TERM, 0), (), None, None, tuple(Member(i, ANY_LIFE) for i in mission.robots))


def is_first(config: Config) -> bool:
    """Return True if no leader is known to have written a config yet."""
    return config.version.term == NO_TERM


def ids(chain: tuple[Member, ...]) -> tuple[int, ...]:
    return tuple([member.id for member in chain])  # called at every control step: a generator takes twice as long


def all_member_ids(mission: Mission) -> tuple[int, ...]:
    """Return every id of the mission, the witness last."""
    return (*mission.robots, WITNESS_ID) if mission.witness else mission.robots


def rank(config: Config, me: int, passable: Gone) -> int:
    """Return the number of candidates before `me` in the election order (E6).

    The order is the chain behind the lost leader, without `passable` members (known to be gone, or not allowed to
    lead); an id outside of it, the lost leader included, comes after it.
    """
    line = config.chain if is_first(config) else config.chain[1:]
    before = 0
    for member in line:
        if member.id == me:
            break
        before += not passable(member)
    return before


def led_by(config: Config, leader: Member, term: Term, gone: Gone, keep_leader: bool = False) -> Config:
    """Return `config` with version `(term, 0)` and the chain `leader`, then the old chain without lost leader and dead.

    With `keep_leader` the old leader has handed its lease over and moves to the tail.
    """
    old = config.chain
    if not is_first(config) and old and old[0].id != leader.id:
        old = (*old[1:], old[0]) if keep_leader else old[1:]
    rest = tuple(m for m in old if m.id != leader.id and not gone(m))
    return Config(Version(term, 0), config.voters, config.tie, config.previous, (leader, *rest))


def unanimous_config(config: Config, leader: Member, term: Term, incarnations: tuple[Member, ...]) -> Config:
    """Return a fresh config of all the `incarnations` that promised; each of them must accept it (E18)."""
    line = [leader.id, *ids(config.chain), *ids(incarnations)]
    known = {m.id: m for m in incarnations}
    chain = tuple(known[i] for i in dict.fromkeys(line) if i in known and i != WITNESS_ID)
    tie = known.get(WITNESS_ID)
    voters = chosen((), chain, tie)
    return Config(Version(term, 0), voters, tie, Electorate(incarnations, tie, "all"), chain)


def chosen(kept: tuple[Member, ...], chain: tuple[Member, ...], witness: Member | None) -> tuple[Member, ...]:
    """Return the voters: `kept`, the witness, then the chain from its head, up to VOTERS_MAX, each id once."""
    voters = list(kept)
    for member in (*(() if witness is None else (witness,)), *chain):
        if len(voters) < VOTERS_MAX and all(member.id != v.id for v in voters):
            voters.append(member)
    return tuple(voters)


def rewritten(
    config: Config, chain: tuple[Member, ...], voters: tuple[Member, ...], tie: Member | None, settled: bool
) -> Config:
    """Return the next config within the term, or `config` itself if nothing changes.

    `settled`: quorums have accepted `config`. Only then may voters change, one change at a time: first jointly with
    the previous voters, then, settled again, alone (E17).
    """
    version = Version(config.version.term, config.version.seq + 1)
    if settled and config.previous is not None:
        return Config(version, config.voters, config.tie, None, chain)
    if settled and (set(voters) != set(config.voters) or tie != config.tie):
        return Config(version, voters, tie, Electorate(config.voters, config.tie), chain)
    if chain != config.chain:
        return Config(version, config.voters, config.tie, config.previous, chain)
    return config
