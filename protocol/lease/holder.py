"""State of a held term from its first PROPOSE: renewal rounds, acknowledgements, expiry (E2), length (E36)."""

from __future__ import annotations

from msgspec import structs

from lfa.protocol.lease.quorum import is_quorum, quorum_time
from lfa.protocol.lease.timing import Timing, lengths_of
from lfa.protocol.messages.consensus import Config, Grant, Member, Propose, Term, Version
from lfa.protocol.messages.header import WIRE_VERSION

ROUNDS_KEPT = 64
"""Number of rounds whose send times are kept for late grants: more than one T_act has in any profile."""
RETRY_HEARTBEATS = 0.5
"""Time, in heartbeats, after which a round without a quorum's grants is followed by the next. A pair without witness
needs both of two messages: at 20 % loss a third of its leaders lost six consecutive rounds, all rounds of one T_act,
within 8 s (L5)."""
RENEWALS_PER_LEASE = 3.0
"""Least length of a lease in units of what a renewal takes: so five heartbeats remain, each of which may be lost."""
NEVER = float("-inf")
NO_ROUND = (NEVER, NEVER)
CALM_S, CALM_S_MAX = 10.0, 160.0
"""Time [s] in which a shorter lease must have been enough before it is asked for; it doubles each time that turns out
to have been too early, for what keeps processes waiting comes and goes."""


class LeaseLength:
    """Which of the profile's leases a holder asks for: grown at once, shrunk after a calm time (E36)."""

    def __init__(self, timing: Timing, now: float) -> None:
        """Begin with the longest, for nothing is known yet."""
        self._lengths = lengths_of(timing)
        self._index = len(self._lengths) - 1
        self._calm_s = CALM_S
        self._calm_from = now

    @property
    def timing(self) -> Timing:
        """Durations that go with the present length."""
        return self._lengths[self._index]

    def fit(self, took_s: float, now: float) -> None:
        """Fit the length to a renewal that takes `took_s` [s] from when it was due, or more, by `now`."""
        if len(self._lengths) == 1:
            return
        enough = (i for i, timing in enumerate(self._lengths) if timing.act_s >= RENEWALS_PER_LEASE * took_s)
        index = next(enough, len(self._lengths) - 1)
        if index > self._index:
            self._index, self._calm_s = index, min(2.0 * self._calm_s, CALM_S_MAX)
        if index >= self._index:
            self._calm_from = now
        elif now >= self._calm_from + self._calm_s:
            self._index, self._calm_from = self._index - 1, now


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
        self._length = LeaseLength(timing, now)
        self._due_at: float | None = now
        """Time [s] at which the renewal that no quorum has granted yet was due; None: none is under way."""
        self._round = 0
        self._rounds: dict[int, tuple[float, float]] = {}
        """Send time of each round, and the end of the lease that it asked for [s]."""
        self._until = NEVER
        """Latest end [s] of a lease that a round has asked for."""
        self._acked: dict[Member, float] = {}
        """Latest end [s] of a lease that each voter has granted."""
        self._accepted: dict[Member, Version] = {}
        """Version of the newest config that each voter has granted."""

    @property
    def timing(self) -> Timing:
        """Durations that go with the lease asked for at present."""
        return self._length.timing

    def next_propose(self, config: Config, now: float) -> Propose:
        """Return the PROPOSE of the next round; `now` is read before the message is sent."""
        due_at = min(now, self.next_round_at) if self._due_at is None else self._due_at
        self._length.fit(now - due_at, now)
        number, self._round = self._round, self._round + 1
        ends_at = now + self.timing.act_s
        # E36: no round asks for less than an earlier one. Voters that a config adds (E17) have granted none of those:
        # by a shorter round they would be free to elect another while the lease lasts that others granted before them.
        until = self._until = max(ends_at, self._until)
        self._rounds[number] = now, until
        self._rounds.pop(number - ROUNDS_KEPT, None)
        longer = self.expiry is not None and self.expiry > ends_at  # by the longer leases of earlier rounds: no hurry
        self._due_at = None if longer else due_at
        self.next_round_at = now + (1.0 if longer else RETRY_HEARTBEATS) * self.timing.heartbeat_s
        fenced = self._fenced if now - self.began_at < self._timing.grant_s else ()
        grant_ms = self._grant_ms(self.timing.act_s if until == ends_at else until - now)
        return Propose(self.term, config, number, self._me, fenced, None, self._agreed, WIRE_VERSION, grant_ms)

    def _grant_ms(self, act_s: float) -> int:
        """Return the bond to ask for [ms] with a lease of `act_s` [s]; 0 for `T_grant`."""
        if act_s >= self._timing.act_s:
            return 0
        return round(1000.0 * structs.replace(self._timing, act_s=act_s).grant_s)

    def transferred(self, number: int, since: float) -> None:
        """Count round `number`, sent by the term's issuer, from `since` [s], a nonce of this process (E16)."""
        self._until = since + self._timing.act_s
        self._rounds[number] = since, self._until
        self._round = number + 1

    def granted(self, src: Member, grant: Grant, config: Config, now: float) -> bool:
        """Count a grant; return True if it extended the lease."""
        self.heard_at[src] = now
        self.nonces[src] = grant.nonce
        if src not in self._accepted or grant.version > self._accepted[src]:
            self._accepted[src] = grant.version
        # E2: the lease counts from the request. Counted from the grant it would outlive the voters' bonds by the
        # delay of the answer, and two robots could lead (I1). E36: and it lasts as long as this round asked for.
        _, until = self._rounds.get(grant.round, NO_ROUND)
        if until <= self._acked.get(src, NEVER):
            return False
        self._acked[src] = until
        granted_until = quorum_time(config, self._acked)
        if granted_until is None:
            return False
        latest_at, latest_until = next(reversed(self._rounds.values()))
        if granted_until >= latest_until:  # the latest round has its quorum: the next may wait
            self.next_round_at = latest_at + self.timing.heartbeat_s
        if self.expiry is not None and granted_until <= self.expiry:
            return False
        self.expiry = granted_until
        if self._due_at is not None:
            self._length.fit(now - self._due_at, now)
            self._due_at = next((sent_at for sent_at, end in self._rounds.values() if end > granted_until), None)
        return True

    def committed(self, config: Config) -> bool:
        """Return True if a quorum has accepted `config` or a later one."""
        return is_quorum(config, {m for m, version in self._accepted.items() if version >= config.version})

    def silent(self, member: Member, now: float, silence_s: float) -> bool:
        """Return True if this incarnation was not heard for `silence_s`."""
        return now - self.heard_at.get(member, self.began_at) > silence_s
