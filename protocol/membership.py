"""Configs: the first one, and how a chain changes. Pure functions; who may write a config is `lease.py`'s matter.

The order of the chain survives every change: the dead leave it, whoever was out returns at the tail (E9).
"""

from __future__ import annotations

from collections.abc import Callable

from protocol.messages import NO_TERM, Config, Member, Term, Version
from protocol.mission import WITNESS_ID, Mission

VOTERS_MAX = 7
"""Lease traffic grows with the voters, not with the team: robots further back in the first chain only learn."""
ANY_LIFE = 0
"""Incarnation of a seat: with a fixed set of voters the seat votes, whichever life of the id sits on it."""


def seat(robot_id: int) -> Member:
    return Member(robot_id, ANY_LIFE)


def first_config(mission: Mission) -> Config:
    """What a team begins with: the mission's order, the first robots as voters, the witness as tie-breaker."""
    tie = seat(WITNESS_ID) if mission.witness else None
    others = () if tie is None else (tie,)
    chain = tuple(seat(robot_id) for robot_id in mission.robots)
    voters = chain[: VOTERS_MAX - len(others)] + others
    return Config(Version(NO_TERM, 0), voters, tie, None, chain)


def is_first(config: Config) -> bool:
    """Nobody has led yet."""
    return config.version.term == NO_TERM


def ids(chain: tuple[Member, ...]) -> tuple[int, ...]:
    return tuple(member.id for member in chain)


def rank(config: Config, me: int, passable: Callable[[int], bool]) -> int:
    """How many others stand before `me` in the line of candidates (E6).

    The line is the chain behind the lost leader, without those who are `passable` (known to be gone, or never
    leading); whoever is not in it, the lost leader included, comes after it.
    """
    line = ids(config.chain if is_first(config) else config.chain[1:])
    before = line[: line.index(me)] if me in line else line
    return sum(not passable(robot_id) for robot_id in before)


def led_by(
    config: Config, leader: Member, term: Term, gone: Callable[[int], bool], keep_leader: bool = False
) -> Config:
    """`config` re-stamped `(term, 0)`: `leader`, then the old chain without its lost leader and without the gone.

    With `keep_leader` the old leader gave its lease away and goes to the tail.
    """
    old = config.chain
    if not is_first(config) and old and old[0].id != leader.id:
        old = (*old[1:], old[0]) if keep_leader else old[1:]
    rest = tuple(m for m in old if m.id != leader.id and not gone(m.id))
    return Config(Version(term, 0), config.voters, config.tie, config.previous, (leader, *rest))


def with_chain(config: Config, chain: tuple[Member, ...]) -> Config:
    """The next version within the term, with another chain."""
    version = Version(config.version.term, config.version.seq + 1)
    return Config(version, config.voters, config.tie, config.previous, chain)
