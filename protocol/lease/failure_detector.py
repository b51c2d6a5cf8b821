"""Failure detector: the newest incarnation heard of each process, and vanished tokens. It may be wrong either way."""

from __future__ import annotations

from lfa.protocol.incarnations import is_later
from lfa.protocol.messages.consensus import Member

LAST_WORDS_HEARTBEATS = 2.0
"""Time, in heartbeats, after its token vanished in which messages of a dead process may still arrive."""

IDS_MAX = 1024
"""Maximum number of ids of which anything is remembered: a name may hold any number, a team has hundreds at most."""


class FailureDetector:
    """What one process has noticed of all others: their messages, and tokens that appeared or vanished."""

    def __init__(self, me: Member, heartbeat_s: float) -> None:
        self._newest: dict[int, int] = {me.id: me.incarnation}
        """Newest incarnation heard, by id."""
        self._heard_at: dict[int, float] = {}
        """Time [s] of the last message, by id."""
        self._gone: dict[int, tuple[int, float]] = {}
        """Incarnation and time [s] of a vanished token, by id."""
        self._tokens: dict[int, int] = {}
        """Incarnation of the token that is there, by id."""
        self._last_words_s = LAST_WORDS_HEARTBEATS * heartbeat_s
        self.vanishings = 0
        """Number of changes of what `is_gone` returns: what follows from it holds until the next one."""
        self.renewals = 0
        """Number of changes of what `is_superseded` returns."""

    def heard(self, src: Member, now: float) -> None:
        """Record a message of `src`.

        An incarnation heard over two heartbeats after its token vanished is alive; earlier messages may be its last.
        """
        if self._is_one_too_many(src.id):
            return
        self._heard_at[src.id] = now
        if src.id not in self._newest or is_later(src.incarnation, self._newest[src.id]):
            self._newest[src.id] = src.incarnation
            self.renewals += 1
        if src.id in self._gone:
            incarnation, since = self._gone[src.id]
            late = now - since > self._last_words_s
            if is_later(src.incarnation, incarnation) or (src.incarnation == incarnation and late):
                self._return(src.id)

    def appeared(self, id: int, incarnation: int) -> None:
        """Record the token of an incarnation; unless it is an earlier one, its id is no longer gone."""
        if self._is_one_too_many(id):
            return
        self._tokens[id] = incarnation
        if id in self._gone and not is_later(self._gone[id][0], incarnation):
            self._return(id)

    def vanished(self, id: int, incarnation: int, now: float) -> None:
        """Record at `now` [s] that a token vanished: this incarnation and all earlier ones of its id are gone."""
        if self._is_one_too_many(id):
            return
        if self._tokens.get(id) == incarnation:
            del self._tokens[id]
        if id in self._gone and is_later(self._gone[id][0], incarnation):
            incarnation = self._gone[id][0]
        self._gone[id] = (incarnation, now)
        self.vanishings += 1

    def is_gone(self, member: Member) -> bool:
        """Return True if the token of this incarnation, or of a later one, vanished."""
        return member.id in self._gone and not is_later(member.incarnation, self._gone[member.id][0])

    def is_here(self, id: int) -> bool:
        """Return True if a token of `id` appeared and has not vanished."""
        return id in self._tokens

    def knows(self, id: int) -> bool:
        """Return True if any incarnation of `id` was heard."""
        return id in self._newest

    def is_superseded(self, member: Member) -> bool:
        """Return True if a later incarnation of it was heard."""
        newest = self._newest.get(member.id, member.incarnation)
        return newest != member.incarnation and is_later(newest, member.incarnation)

    def later_than(self, member: Member) -> int | None:
        """Return the number of a later incarnation that was heard or whose token vanished; None if there is none."""
        gone, _ = self._gone.get(member.id, (member.incarnation, 0.0))
        newest = self._newest.get(member.id, member.incarnation)
        newest = gone if is_later(gone, newest) else newest
        return newest if is_later(newest, member.incarnation) else None

    def last_of(self, member: Member, now: float, silence_s: float) -> Member:
        """Return the newest known incarnation of its id, `member` included; `member` itself if one was just heard."""
        later = self.later_than(member)
        just_heard = now - self._heard_at.get(member.id, float("-inf")) <= silence_s
        return member if later is None or just_heard else Member(member.id, later)

    def has_ended(self, member: Member) -> bool:
        """Return True if no answer of this incarnation is expected: a later one was heard, or its token vanished."""
        return self.is_superseded(member) or self.is_gone(member)

    def _is_one_too_many(self, id: int) -> bool:
        if id in self._newest or id in self._tokens or id in self._gone:
            return False
        return max(len(self._newest), len(self._tokens), len(self._gone)) >= IDS_MAX

    def _return(self, id: int) -> None:
        del self._gone[id]
        self.vanishings += 1
