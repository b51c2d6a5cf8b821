"""Voter of a process: its promise, its bond and its refusals (rules E1-E4).

No state is kept on disk. A process that starts or restarts is a new member: it grants only under a config that names
this incarnation, and its promises count in a unanimous start only (E1, E18).
"""

from __future__ import annotations

from msgspec import Struct

from lfa.protocol.lease.membership import is_first
from lfa.protocol.messages.consensus import Config, Grant, Grantee, Member, Nack, Prepare, Promise, Propose, Term


class Bond(Struct, frozen=True):
    """Grant given to one holder: until `expiry` (own monotonic time [s]) no other holder gets one."""

    term: Term
    holder: Member
    expiry: float


class Acceptor:
    """Voter of one process: it grants no term below `promised`, and none up to `released`, ever again."""

    def __init__(self, floor: Term, grant_s: float, now: float) -> None:
        """Start at `now` [s] without memory: silent for `T_grant`, while an earlier life may be bound."""
        self.promised = floor
        self.released = Term()
        self.bond: Bond | None = None
        self.silent_until = now + grant_s
        self._grant_s = grant_s

    def bound(self, now: float) -> Bond | None:
        """Return the grant still in force at `now` [s]; None if there is none."""
        return self.bond if self.bond is not None and now < self.bond.expiry else None

    def prepare(
        self, src: Member, body: Prepare, config: Config, now: float, holder_gone: bool = False
    ) -> Promise | Nack | None:
        """Answer phase 1. A refusal changes no state, so asking a bound voter is harmless: it is the pre-vote.

        Returns None while a blank voter is silent (E1). E15: with `holder_gone` (the token of the bond's holder has
        vanished) the voter promises nevertheless, and names the term to be fenced first: a liveliness event alone
        frees no voter.
        """
        blank = is_first(config)
        if blank and now < self.silent_until:
            return None  # E1
        bond = self.bound(now)
        foreign = bond is not None and bond.holder != src
        outdated = body.term < self.promised or body.term <= self.released or config.version > body.version
        if (foreign and not holder_gone) or outdated:
            return self.refusal(body.term, config, now)
        self.promised = body.term
        needs_fence = Grantee(bond.term, bond.holder) if bond is not None else None
        return Promise(body.term, config, needs_fence, blank)

    def propose(self, src: Member, body: Propose, config: Config, now: float) -> Grant | Nack:
        """Answer phase 2: first grant and renewal alike."""
        outdated = body.term < self.promised or body.term <= self.released or config.version > body.config.version
        bond = self.bound(now)
        # E3: a bound voter grants only to its holder, to that holder's successor (E16), or after its term is fenced.
        foreign = bond is not None and bond.holder not in (body.holder, src) and bond.term not in body.fenced
        if outdated or foreign:
            return self.refusal(body.term, config, now)
        self.promised = body.term
        # E2: the voter counts from now, the holder from before it asked: delay can only shorten the holder's lease.
        self.bond = Bond(body.term, body.holder, self.kept_until(body, now))
        return Grant(body.term, body.round, body.config.version, nonce=now)

    def kept_until(self, body: Propose, now: float) -> float:
        """Return the end [s] of the bond that `body` asks for; not before what its holder was promised already (E36).

        The holder counts on the longest lease that its quorum has granted, also when it asks for a shorter one by now.
        """
        until = now + (min(body.grant_ms / 1000.0, self._grant_s) if body.grant_ms else self._grant_s)
        return until if self.bond is None or self.bond.holder != body.holder else max(until, self.bond.expiry)

    def release(self, term: Term) -> bool:
        """Record that the holder of `term` has stopped; return True if that ended this voter's bond (E4)."""
        self.released = max(self.released, term)
        # Terms up to `term` are never granted again, so they are not promised either, and refusals name the term to
        # exceed: other processes may have restarted since, with lower terms.
        self.promised = max(self.promised, term)
        if self.bond is None or self.bond.term != term:
            return False
        self.bond = None
        return True

    def refusal(self, term: Term, config: Config, now: float) -> Nack:
        """Return the refusal: the remaining bond [s], the term to exceed, and the newest config."""
        bond = self.bound(now)
        if bond is None:
            return Nack(term, self.promised, None, 0.0, config)
        return Nack(term, self.promised, bond.holder, bond.expiry - now, config)
