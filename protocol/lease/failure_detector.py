"""What one process knows of the others' lives: which was heard last, and whose token vanished. Hints, never proofs."""

from __future__ import annotations

from lfa.protocol.messages.consensus import Member

NEVER_HEARD = -1
LAST_WORDS_HEARTBEATS = 2.0
"""How long after its token vanished a process may still be heard without being alive."""


class FailureDetector:
    def __init__(self, me: Member, heartbeat_s: float) -> None:
        self._newest: dict[int, int] = {me.id: me.incarnation}
        """Of each id the newest life that was heard."""
        self._gone: dict[int, tuple[int, float]] = {}
        """Of each id whose token vanished: the incarnation that it vanished of, and when."""
        self._last_words_s = LAST_WORDS_HEARTBEATS * heartbeat_s

    def heard(self, src: Member, now: float) -> None:
        """A life that still speaks two heartbeats after its token vanished is not dead; until then, last words."""
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
        """The token of this life, or of a later one, vanished."""
        return member.id in self._gone and self._gone[member.id][0] >= member.incarnation

    def knows(self, id: int) -> bool:
        """Some life of it was heard."""
        return id in self._newest

    def is_superseded(self, member: Member) -> bool:
        """A later life of it was heard."""
        return self._newest.get(member.id, NEVER_HEARD) > member.incarnation

    def has_ended(self, member: Member) -> bool:
        """No answer is to be expected of this life: a later one was heard, or its token vanished."""
        return self.is_superseded(member) or self.is_gone(member)
