"""State of a held term from its first PROPOSE: renewal rounds, acknowledgements, expiry (rule E2)."""

from __future__ import annotations

from lfa.protocol.lease.quorum import is_quorum, quorum_time
from lfa.protocol.lease.timing import Timing
from lfa.protocol.messages.consensus import Config, Grant, Member, Propose, Term, Version
from lfa.protocol.messages.header import WIRE_VERSION

ROUNDS_KEPT = 64
"""Number of rounds whose send times are kept for late grants: more than one T_act has in any profile."""
RETRY_HEARTBEATS = 0.5
"""Time, in heartbeats, after which a round without a quorum's grants is followed by the next. A pair without witness
needs both of two messages: at 20 % loss a third of its leaders lost six consecutive rounds, all rounds of one T_act,
within 8 s (L5)."""


class Holder:
    """Renewal state of one term. `expiry` is None until a quorum has granted; it only grows."""

    def __init__(
        self, me: Member, term: Term, timing: Timing, now: float, agreed: int, fenced: tuple[Term, ...] = ()
    ) -> None:
        self.term = term
        self.expiry: float | None = None
        self.next_round_at = now
        self.heard_at: dict[Member, float] = {}
        """Time [s] of the last message of each incarnation to this holder."""
        self.said_hello: list[Member] = []
        """Incarnations that sent HELLO, in order."""
        self.began_at = now
        self.nonces: dict[Member, float] = {}
        """Time [s] of each voter's own clock carried by its last grant (E16)."""
        self._agreed = agreed
        self._fenced = fenced
        self._me = me
        self._timing = timing
        self._round = 0
        self._sent_at: dict[int, float] = {}
        self._acked: dict[Member, float] = {}
        """Send time [s] of the newest round that each voter has granted."""
        self._accepted: dict[Member, Version] = {}
        """Version of the newest config that each voter has granted."""

    def next_propose(self, config: Config, now: float) -> Propose:
        """Return the PROPOSE of the next round; `now` is read before the message is sent."""
        number, self._round = self._round, self._round + 1
        self._sent_at[number] = now
        self._sent_at.pop(number - ROUNDS_KEPT, None)
        self.next_round_at = now + RETRY_HEARTBEATS * self._timing.heartbeat_s
        fenced = self._fenced if now - self.began_at < self._timing.grant_s else ()
        return Propose(self.term, config, number, self._me, fenced, agreed=self._agreed, wire=WIRE_VERSION)

    def transferred(self, number: int, since: float) -> None:
        """Count round `number`, sent by the term's issuer, from `since` [s], a nonce of this process (E16)."""
        self._sent_at[number] = since
        self._round = number + 1

    def granted(self, src: Member, grant: Grant, config: Config, now: float) -> bool:
        """Count a grant; return True if it extended the lease."""
        self.heard_at[src] = now
        self.nonces[src] = grant.nonce
        if src not in self._accepted or grant.version > self._accepted[src]:
            self._accepted[src] = grant.version
        sent_at = self._sent_at.get(grant.round)
        if sent_at is None or sent_at <= self._acked.get(src, float("-inf")):
            return False
        self._acked[src] = sent_at
        # E2: the lease counts from the request. Counted from the grant it would outlive the voters' bonds by the
        # delay of the answer, and two robots could lead (I1).
        since = quorum_time(config, self._acked)
        if since is None:
            return False
        if since == self._sent_at.get(self._round - 1):  # the latest round has its quorum: the next may wait
            self.next_round_at = since + self._timing.heartbeat_s
        if self.expiry is not None and since + self._timing.act_s <= self.expiry:
            return False
        self.expiry = since + self._timing.act_s
        return True

    def committed(self, config: Config) -> bool:
        """Return True if a quorum has accepted `config` or a later one."""
        return is_quorum(config, {m for m, version in self._accepted.items() if version >= config.version})

    def silent(self, member: Member, now: float, silence_s: float) -> bool:
        """Return True if this incarnation was not heard for `silence_s`."""
        return now - self.heard_at.get(member, self.began_at) > silence_s
