"""Failure detector: the newest incarnation heard of each process, and vanished tokens. It may be wrong either way."""

from __future__ import annotations

from lfa.protocol.messages.consensus import Member

NEVER_HEARD = -1
LAST_WORDS_HEARTBEATS = 2.0
"""Time, in heartbeats, after its token vanished in which messages of a dead process may still arrive."""


class FailureDetector:
    def __init__(self, me: Member, heartbeat_s: float) -> None:
        self._newest: dict[int, int] = {me.id: me.incarnation}
        """Newest incarnation heard, by id."""
        self._gone: dict[int, tuple[int, float]] = {}
        """Incarnation and time [s] of a vanished token, by id."""
        self._last_words_s = LAST_WORDS_HEARTBEATS * heartbeat_s

    def heard(self, src: Member, now: float) -> None:
        """Record a message of `src`.

        An incarnation heard over two heartbeats after its token vanished is alive; earlier messages may be its last.
        """
        if src.incarnation > self._newest.get(src.id, NEVER_HEARD):
            self._newest[src.id] = src.incarnation
        if src.id in self._gone:
            incarnation, since = self._gone[src.id]
            late = now - since > self._last_words_s
            if src.incarnation > incarnation or (src.incarnation == incarnation and late):
                del self._gone[src.id]

    def appeared(self, id: int, incarnation: int) -> None:
        if id in self._gone and incarnation >= self._gone[id][0]:
            del self._gone[id]

    def vanished(self, id: int, incarnation: int, now: float) -> None:
        self._gone[id] = (max(incarnation, self._gone.get(id, (0, now))[0]), now)

    def is_gone(self, member: Member) -> bool:
        """Return True if the token of this incarnation, or of a later one, vanished."""
        return member.id in self._gone and self._gone[member.id][0] >= member.incarnation

    def knows(self, id: int) -> bool:
        """Return True if any incarnation of `id` was heard."""
        return id in self._newest

    def is_superseded(self, member: Member) -> bool:
        """Return True if a later incarnation of it was heard."""
        return self._newest.get(member.id, NEVER_HEARD) > member.incarnation

    def has_ended(self, member: Member) -> bool:
        """Return True if no answer of this incarnation is expected: a later one was heard, or its token vanished."""
        return self.is_superseded(member) or self.is_gone(member)
