"""Configs: the first one, and how voters and chain change. Pure functions; who may write one is `lease.py`'s matter.

The order of the chain survives every change: the dead leave it, whoever was out returns at the tail (E9). Voters change
jointly (E17): the new config counts with the quorums of both, until both have accepted it.
"""

from __future__ import annotations

from collections.abc import Callable

from lfa.protocol.messages.consensus import NO_TERM, Config, Electorate, Member, Term, Version
from lfa.protocol.mission import Mission
from lfa.protocol.names import WITNESS_ID

VOTERS_MAX = 7
"""Lease traffic grows with the voters, not with the team: robots further back only learn."""
ANY_LIFE = 0
"""Incarnation in the config that nobody has written: it names no life, so nobody can vote in it."""

Gone = Callable[[Member], bool]


def first_config(mission: Mission) -> Config:
    """What a process knows that has heard nothing: the mission's order, and no voters."""
    return Config(Version(NO_TERM, 0), (), None, None, tuple(Member(i, ANY_LIFE) for i in mission.robots))


def is_first(config: Config) -> bool:
    """Nobody has led yet, as far as is known."""
    return config.version.term == NO_TERM


def ids(chain: tuple[Member, ...]) -> tuple[int, ...]:
    return tuple([member.id for member in chain])  # asked for at every control step: a generator takes twice as long


def all_member_ids(mission: Mission) -> tuple[int, ...]:
    """Every id that the mission names, the witness last."""
    return (*mission.robots, WITNESS_ID) if mission.witness else mission.robots


def rank(config: Config, me: int, passable: Gone) -> int:
    """How many others stand before `me` in the line of candidates (E6).

    The line is the chain behind the lost leader, without those who are `passable` (known to be gone, or never
    leading); whoever is not in it, the lost leader included, comes after it.
    """
    line = config.chain if is_first(config) else config.chain[1:]
    before = 0
    for member in line:
        if member.id == me:
            break
        before += not passable(member)
    return before


def led_by(config: Config, leader: Member, term: Term, gone: Gone, keep_leader: bool = False) -> Config:
    """`config` re-stamped `(term, 0)`: `leader`, then the old chain without its lost leader and without the gone.

    With `keep_leader` the old leader gave its lease away and goes to the tail.
    """
    old = config.chain
    if not is_first(config) and old and old[0].id != leader.id:
        old = (*old[1:], old[0]) if keep_leader else old[1:]
    rest = tuple(m for m in old if m.id != leader.id and not gone(m))
    return Config(Version(term, 0), config.voters, config.tie, config.previous, (leader, *rest))


def unanimous_config(config: Config, leader: Member, term: Term, lives: tuple[Member, ...]) -> Config:
    """E18: a fresh config of all the lives that promised; every one of them must accept it."""
    line = [leader.id, *ids(config.chain), *ids(lives)]
    known = {m.id: m for m in lives}
    chain = tuple(known[i] for i in dict.fromkeys(line) if i in known and i != WITNESS_ID)
    tie = known.get(WITNESS_ID)
    voters = chosen((), chain, tie)
    return Config(Version(term, 0), voters, tie, Electorate(lives, tie, "all"), chain)


def chosen(kept: tuple[Member, ...], chain: tuple[Member, ...], witness: Member | None) -> tuple[Member, ...]:
    """Voters: those `kept`, the witness, then the chain from its head, up to VOTERS_MAX, each id once."""
    voters = list(kept)
    for member in (*(() if witness is None else (witness,)), *chain):
        if len(voters) < VOTERS_MAX and all(member.id != v.id for v in voters):
            voters.append(member)
    return tuple(voters)


def rewritten(
    config: Config, chain: tuple[Member, ...], voters: tuple[Member, ...], tie: Member | None, settled: bool
) -> Config:
    """The next config within the term, or `config` itself when nothing changes.

    `settled`: quorums have accepted `config`. Only then may voters change, one change at a time: first joint with the
    previous voters, then, settled again, alone (E17).
    """
    version = Version(config.version.term, config.version.seq + 1)
    if settled and config.previous is not None:
        return Config(version, config.voters, config.tie, None, chain)
    if settled and (set(voters) != set(config.voters) or tie != config.tie):
        return Config(version, voters, tie, Electorate(config.voters, config.tie), chain)
    if chain != config.chain:
        return Config(version, config.voters, config.tie, config.previous, chain)
    return config
