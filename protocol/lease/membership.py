"""Configs: the first one, and changes of voters and chain. Pure functions; `lease.py` decides who may write a config.

Every change keeps the order of the chain: dead robots leave it, returning robots join at the tail (E9). Voters change
jointly (E17): the new config needs quorums of both electorates, until both have accepted it.
"""

from __future__ import annotations

from collections.abc import Callable

from msgspec import structs

from lfa.protocol.errors import Refused
from lfa.protocol.messages.consensus import NO_TERM, Config, Electorate, Member, Roster, Spare, Term, Version
from lfa.protocol.mission import Mission
from lfa.protocol.names import WITNESS_ID, robot_name

VOTERS_MAX = 7
"""Maximum number of voters: lease traffic grows with the voters, not with the team; further robots only learn."""
SPARES_MAX = 16
"""Maximum number of spares: every round carries their ids."""
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
    """Return the ids of a chain, in order."""
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

    With `keep_leader` the old leader has handed its lease over and moves to the tail. `config` is not the first one,
    which no quorum of promises can know.
    """
    old = config.chain
    if old[0].id != leader.id:
        old = (*old[1:], old[0]) if keep_leader else old[1:]
    rest = tuple(m for m in old if m.id != leader.id and not gone(m))
    return structs.replace(config, version=Version(term, 0), chain=(leader, *rest))


def unanimous_config(config: Config, leader: Member, term: Term, incarnations: tuple[Member, ...]) -> Config:
    """Return a fresh config of all the `incarnations` that promised; each of them must accept it (E18)."""
    line = [leader.id, *ids(config.chain), *ids(incarnations)]
    known = {m.id: m for m in incarnations}
    out = (WITNESS_ID, *config.roster.retired)
    chain = tuple(known[i] for i in dict.fromkeys(line) if i in known and i not in out)
    tie = known.get(WITNESS_ID)
    voters = chosen((), chain, tie, config.roster)
    return Config(Version(term, 0), voters, tie, Electorate(incarnations, tie, "all"), chain, config.roster)


def chosen(
    kept: tuple[Member, ...], chain: tuple[Member, ...], witness: Member | None, roster: Roster
) -> tuple[Member, ...]:
    """Return the voters: `kept`, the witness, then the chain from its head, up to VOTERS_MAX, each id once.

    The last spares do not vote if there would not be more voters that the mission names (E33).
    """
    voters = list(kept)
    for member in (*(() if witness is None else (witness,)), *chain):
        if len(voters) < VOTERS_MAX and all(member.id != v.id for v in voters):
            voters.append(member)
    spares = [voter for voter in voters if is_spare(roster, voter.id)]
    surplus = spares[max(len(voters) - len(spares) - 1, 0) :]
    return tuple(voter for voter in voters if voter not in surplus)


def is_spare(roster: Roster, robot_id: int) -> bool:
    """Return True if operators have admitted this robot, which the mission does not name (E33)."""
    return any(spare.id == robot_id for spare in roster.spares)


def placed(
    chain: tuple[Member, ...], newcomers: tuple[Member, ...], roster: Roster, order: tuple[int, ...]
) -> tuple[Member, ...]:
    """Return the chain with the newcomers at its tail (E9), or in the place of the robot for which a spare stands.

    `order`: the chain as the mission has it. Nobody is put before the leader.
    """
    slot_of = {spare.id: spare.slot_of for spare in roster.spares}
    for member in newcomers:
        missing, at = slot_of.get(member.id, 0), len(chain)
        if missing in order and missing not in ids(chain):
            behind = order[order.index(missing) + 1 :]
            at = next((n for n, other in enumerate(chain) if n > 0 and other.id in behind), at)
        chain = (*chain[:at], member, *chain[at:])
    return chain


def rewritten(
    config: Config,
    chain: tuple[Member, ...],
    voters: tuple[Member, ...],
    tie: Member | None,
    roster: Roster,
    settled: bool,
) -> Config:
    """Return the next config within the term, or `config` itself if nothing changes.

    `settled`: quorums have accepted `config`. Only then may voters change, one change at a time: first jointly with
    the previous voters, then, settled again, alone (E17).
    """
    version = Version(config.version.term, config.version.seq + 1)
    if settled and config.previous is not None:
        return Config(version, config.voters, config.tie, None, chain, roster)
    if settled and (set(voters) != set(config.voters) or tie != config.tie):
        return Config(version, voters, tie, Electorate(config.voters, config.tie), chain, roster)
    if chain != config.chain or roster != config.roster:
        return Config(version, config.voters, config.tie, config.previous, chain, roster)
    return config


# --- rosters (E33, E34) -------------------------------------------------------------------------------------------


def team_of(roster: Roster, robots: tuple[int, ...]) -> tuple[int, ...]:
    """Return the ids of the team: the mission's `robots` and the spares, without the retired ones."""
    everybody = (*robots, *(spare.id for spare in roster.spares))
    return tuple(robot for robot in everybody if robot not in roster.retired)


def joined(roster: Roster, robots: tuple[int, ...], chain: tuple[int, ...], robot_id: int, slot_of: int) -> Roster:
    """Return the roster with `robot_id` in the team, in the place of robot `slot_of` (0: at the tail). Raises Refused.

    `robots` are those of the mission, `chain` the present one.
    """
    team = team_of(roster, robots)
    if robot_id in team:
        raise Refused(f"join {robot_id}: this id is in use, must be none of {list(team)}")
    if slot_of and slot_of not in robots:
        raise Refused(f"join {robot_id} --for {slot_of}: must be a robot of the mission, one of {list(robots)}")
    if slot_of in chain:
        raise Refused(f"join {robot_id} --for {slot_of}: {robot_name(slot_of)} is in the chain, must be out of it")
    kept = tuple(spare for spare in roster.spares if spare.id != robot_id)
    spares = kept if robot_id in robots else (*kept, Spare(robot_id, slot_of))
    if len(spares) > SPARES_MAX:
        raise Refused(f"join {robot_id}: {len(kept)} spares have joined, must be at most {SPARES_MAX}")
    return Roster(spares, tuple(other for other in roster.retired if other != robot_id))


def retired(roster: Roster, robots: tuple[int, ...], chain: tuple[int, ...], robot_id: int) -> Roster:
    """Return the roster without `robot_id`. Raises Refused for a robot that is not in the team, and for the last."""
    team = team_of(roster, robots)
    if robot_id not in team:
        raise Refused(f"retire {robot_id}: not in the team, must be one of {list(team)}")
    if not set(chain) - {robot_id}:
        raise Refused(
            f"retire {robot_id}: {robot_name(robot_id)} is the last of the chain, must leave another one there"
        )
    return structs.replace(roster, retired=(*roster.retired, robot_id))
