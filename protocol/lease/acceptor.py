"""The voter in every process: what it has promised, to whom it is bound and for how long (rules E1-E4).

Nothing here is kept on disk. A process that starts, also one that starts again, is a new member: it grants when a
config names this very life of it, and its promises count in a full house only (E1, E18).
"""

from __future__ import annotations

from msgspec import Struct

from lfa.protocol.lease.membership import is_first
from lfa.protocol.messages.consensus import Config, Grant, Grantee, Member, Nack, Prepare, Promise, Propose, Term


class Bond(Struct, frozen=True):
    """A grant that was given: until `expiry` (own monotonic time [s]) nobody else gets one."""

    term: Term
    holder: Member
    expiry: float


class Acceptor:
    def __init__(self, floor: Term, grant_s: float, now: float) -> None:
        self.promised = floor
        self.released = Term()
        self.bond: Bond | None = None
        self.silent_until = now + grant_s
        self._grant_s = grant_s

    def bound(self, now: float) -> Bond | None:
        """The grant that is still in force."""
        return self.bond if self.bond is not None and now < self.bond.expiry else None

    def prepare(
        self, src: Member, body: Prepare, config: Config, now: float, holder_gone: bool = False
    ) -> Promise | Nack | None:
        """Phase 1. Refusing changes nothing here, so asking a bound voter is harmless: it is the pre-vote.

        E15: with `holder_gone`, a hint that the bond's holder is dead, the voter promises all the same, but tells
        which term has to be fenced first: the hint alone frees nobody.
        """
        blank = is_first(config)
        if blank and now < self.silent_until:
            return None  # E1
        bond = self.bound(now)
        foreign = bond is not None and bond.holder != src
        if (foreign and not holder_gone) or body.term < self.promised or config.version > body.version:
            return self.refusal(body.term, config, now)
        self.promised = body.term
        needs_fence = Grantee(bond.term, bond.holder) if bond is not None else None
        return Promise(body.term, config, needs_fence, blank)

    def propose(self, src: Member, body: Propose, config: Config, now: float) -> Grant | Nack:
        """Phase 2: first grant and renewal alike."""
        outdated = body.term < self.promised or body.term <= self.released or config.version > body.config.version
        bond = self.bound(now)
        # E3: bound voters grant to their holder or to whom it hands over (E16), or when its term can move nothing more.
        foreign = bond is not None and bond.holder not in (body.holder, src) and bond.term not in body.fenced
        if outdated or foreign:
            return self.refusal(body.term, config, now)
        self.promised = body.term
        # E2: the voter counts from now, the holder from before it asked: delay can only shorten what the holder has.
        self.bond = Bond(body.term, body.holder, now + self._grant_s)
        return Grant(body.term, body.round, body.config.version, nonce=now)

    def release(self, term: Term) -> bool:
        """E4: the holder of exactly `term` has stopped; answers whether that freed this voter."""
        self.released = max(self.released, term)
        # Nothing up to here is granted any more, so nothing is promised, and refusals say what beats it: others may
        # have started anew, with terms below, since.
        self.promised = max(self.promised, term)
        if self.bond is None or self.bond.term != term:
            return False
        self.bond = None
        return True

    def refusal(self, term: Term, config: Config, now: float) -> Nack:
        """When to try again, what to beat, and the newest config."""
        bond = self.bound(now)
        if bond is None:
            return Nack(term, self.promised, None, 0.0, config)
        return Nack(term, self.promised, bond.holder, bond.expiry - now, config)
