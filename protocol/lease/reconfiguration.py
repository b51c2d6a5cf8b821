"""Changes of a leader's config when robots leave and join: a pure function of its knowledge.

Rules E8, E9, E17, E22, E33 and E34.
"""

from __future__ import annotations

from math import inf

from msgspec import Struct

from lfa.protocol.lease.failure_detector import FailureDetector
from lfa.protocol.lease.holder import Holder
from lfa.protocol.lease.membership import chosen, placed, rewritten
from lfa.protocol.lease.timing import Timing
from lfa.protocol.messages.consensus import Config, Member, Roster
from lfa.protocol.mission import Shrink, TieBreak
from lfa.protocol.names import WITNESS_ID


class Policy(Struct, frozen=True):
    """Reconfiguration settings of the mission."""

    tiebreak: TieBreak
    shrink: Shrink
    robots: tuple[int, ...]
    """Robots of the mission, in the order of the first chain."""
    witness: bool

    def everybody(self, roster: Roster) -> int:
        """Return the number of ids of the team by `roster`, the witness included."""
        robots = {*self.robots, *(spare.id for spare in roster.spares)} - set(roster.retired)
        return len(robots) + self.witness


class Calm:
    """Knowledge that a config stays, without another look at each of its members: a chain may be of a hundred.

    A leader asks with each round, and with each HELLO of a robot that has no vote.
    """

    def __init__(self) -> None:
        self._of: tuple[Config, Holder] | None = None
        self._taken_in: frozenset[Member] = frozenset()
        """Whose HELLO changes nothing: a robot of the chain, a witness that votes; not a voter outside of the chain."""
        self._oldest = 0.0
        """Time [s] at which the member heard longest ago was heard, or before; none but the leader is left out."""
        self._changes = (0, 0)

    def note(
        self, config: Config, holder: Holder, me: Member, peers: FailureDetector, left_out: frozenset[int]
    ) -> None:
        """Note that `reshaped` keeps `config`, if only silence, a token, an incarnation or a newcomer changes that."""
        self._of = None
        if config.previous is not None or left_out or config.roster.retired or not holder.committed(config):
            return
        others = {*config.chain, *config.voters} - {me}
        taken_in = frozenset((*config.chain, *(m for m in config.voters if m.id == WITNESS_ID)))
        if taken_in.issuperset(holder.said_hello) and not any(map(peers.has_ended, others)):
            self._of, self._taken_in = (config, holder), taken_in
            self._oldest = min((holder.heard_at.get(m, holder.began_at) for m in others), default=inf)
            self._changes = peers.vanishings, peers.renewals

    def holds(
        self, config: Config, holder: Holder, peers: FailureDetector, left_out: frozenset[int], timing: Timing,
        now: float,
    ) -> bool:  # fmt: skip
        """Return True if `reshaped` keeps `config` at `now` [s], under its own roster."""
        if self._of is None or self._of[0] is not config or self._of[1] is not holder or left_out:
            return False
        heard = now - self._oldest <= min(timing.chain_silence_s, timing.remove_silence_s)
        same = self._changes == (peers.vanishings, peers.renewals)
        return heard and same and self._taken_in.issuperset(holder.said_hello)


def reshaped(
    config: Config, holder: Holder, me: Member, peers: FailureDetector, left_out: frozenset[int], policy: Policy,
    timing: Timing, now: float, roster: Roster,
) -> Config:  # fmt: skip
    """Return the next config, or `config` itself if nothing changes.

    Dead and retired robots leave the chain, robots that sent HELLO join its tail, and the voters follow, jointly.
    """
    left = {*left_out, *roster.retired}

    def stays(member: Member, silence_s: float) -> bool:
        return member == me or not (holder.silent(member, now, silence_s) or peers.is_superseded(member))

    def out(member: Member) -> bool:
        return peers.is_gone(member) or (member.id in left and member != me)

    here = [m for m in config.chain if not out(m) and stays(m, timing.chain_silence_s)]
    asking = [m for m in holder.said_hello if not peers.is_gone(m) and stays(m, timing.chain_silence_s)]
    present = {m.id for m in here}
    new = tuple(m for m in asking if m.id != WITNESS_ID and m.id not in present and not out(m))
    chain = placed(tuple(here), new, roster, policy.robots)
    kept = tuple(m for m in config.voters if m.id not in roster.retired and stays(m, timing.remove_silence_s))
    witness = next((m for m in (*kept, *asking) if m.id == WITNESS_ID), None)
    voters = chosen(kept, chain, witness, roster)
    if policy.shrink == "static" and 2 * len(voters) <= policy.everybody(roster):
        voters = config.voters
    tie = me if policy.tiebreak == "head" else witness if policy.tiebreak == "witness" else None
    return rewritten(config, chain, voters, tie, roster, holder.committed(config))
