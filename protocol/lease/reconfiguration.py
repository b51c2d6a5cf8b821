"""Changes of a leader's config when robots leave and join: a pure function of its knowledge.

Rules E8, E9, E17, E22, E33 and E34.
"""

from __future__ import annotations

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
