"""One term in the hands of one process, from its first PROPOSE: rounds, acknowledgements, expiry (rule E2)."""

from __future__ import annotations

from lfa.protocol.lease.quorum import is_quorum, quorum_time
from lfa.protocol.lease.timing import Timing
from lfa.protocol.messages.consensus import Config, Grant, Member, Propose, Term, Version

ROUNDS_KEPT = 64
"""Send times kept for late grants: more than the rounds of one T_act in any profile."""
RETRY_HEARTBEATS = 0.5
"""When a round that no quorum has granted is followed by the next. A pair without witness needs both of two messages:
at 20 % loss a third of its leaders lost six rounds in a row, all there are in T_act, within 8 s (L5)."""


class Holder:
    """`expiry` is None until a quorum has granted; it only grows."""

    def __init__(self, me: Member, term: Term, timing: Timing, now: float, fenced: tuple[Term, ...] = ()) -> None:
        self.term = term
        self.expiry: float | None = None
        self.next_round_at = now
        self.heard_at: dict[Member, float] = {}
        """When each life last gave a sign of itself to this holder."""
        self.said_hello: list[Member] = []
        """Lives that asked to be let in, in the order of asking."""
        self.began_at = now
        self.nonces: dict[Member, float] = {}
        """Of each voter the moment of its own clock that its last grant carried (E16)."""
        self._fenced = fenced
        self._me = me
        self._timing = timing
        self._round = 0
        self._sent_at: dict[int, float] = {}
        self._acked: dict[Member, float] = {}
        """Of each voter the newest send time [s] that it has granted."""
        self._accepted: dict[Member, Version] = {}
        """Of each voter the newest config that it has granted."""

    def next_propose(self, config: Config, now: float) -> Propose:
        """The next round; `now` is read before the message leaves."""
        number, self._round = self._round, self._round + 1
        self._sent_at[number] = now
        self._sent_at.pop(number - ROUNDS_KEPT, None)
        self.next_round_at = now + RETRY_HEARTBEATS * self._timing.heartbeat_s
        fenced = self._fenced if now - self.began_at < self._timing.grant_s else ()
        return Propose(self.term, config, number, self._me, fenced)

    def transferred(self, number: int, since: float) -> None:
        """E16: round `number` was asked by the term's issuer; it counts from `since`, a moment that we told it."""
        self._sent_at[number] = since
        self._round = number + 1

    def granted(self, src: Member, grant: Grant, config: Config, now: float) -> bool:
        """Count a grant; answers whether the lease got longer."""
        self.heard_at[src] = now
        self.nonces[src] = grant.nonce
        if src not in self._accepted or grant.version > self._accepted[src]:
            self._accepted[src] = grant.version
        sent_at = self._sent_at.get(grant.round)
        if sent_at is None or sent_at <= self._acked.get(src, float("-inf")):
            return False
        self._acked[src] = sent_at
        # E2: the lease runs from when we asked. Counted from the grant it would outlive the voters' own count by
        # the way back, and two robots could lead (I1).
        since = quorum_time(config, self._acked)
        if since is None:
            return False
        if since == self._sent_at.get(self._round - 1):  # this round is through: there is time for the next
            self.next_round_at = since + self._timing.heartbeat_s
        if self.expiry is not None and since + self._timing.act_s <= self.expiry:
            return False
        self.expiry = since + self._timing.act_s
        return True

    def committed(self, config: Config) -> bool:
        """A quorum has accepted `config` or a later one."""
        return is_quorum(config, {m for m, version in self._accepted.items() if version >= config.version})

    def silent(self, member: Member, now: float, silence_s: float) -> bool:
        """Nothing was heard of this life for `silence_s`."""
        return now - self.heard_at.get(member, self.began_at) > silence_s
