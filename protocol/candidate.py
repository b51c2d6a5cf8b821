"""One attempt to lead: a term, the promises for it, and when to ask again (rule E5).

The term stays the same while the attempt only repeats itself, so a robot that nobody hears does not drive terms up.
"""

from __future__ import annotations

from protocol.holder import Holder
from protocol.membership import seat
from protocol.messages import Config, Member, Term
from protocol.quorum import electors, is_quorum
from protocol.timing import Timing

PAUSE_GROWTH = 1.5


class Candidate:
    def __init__(self, term: Term, timing: Timing, now: float) -> None:
        self.term = term
        self.ask_at = now
        self.holder: Holder | None = None
        """Set once the first PROPOSE has left: the term as it is being granted."""
        self._promised: set[Member] = set()
        self._refused: set[Member] = set()
        self._pause_s = 2.0 * timing.rank_step_s
        self._pause_s_max = 2.0 * timing.heartbeat_s

    def asked(self, now: float) -> None:
        """A PREPARE leaves: each pause is longer than the one before, up to two heartbeats."""
        self.ask_at = now + self._pause_s
        self._pause_s = min(self._pause_s * PAUSE_GROWTH, self._pause_s_max)

    def wait_until(self, at: float) -> None:
        """A voter is bound until then: asking it before is idle."""
        self.ask_at = max(self.ask_at, at)

    @property
    def deadline(self) -> float:
        return self.ask_at if self.holder is None else self.holder.next_round_at

    def promised(self, src: Member) -> None:
        self._promised.add(seat(src.id))

    def refused(self, src: Member, config: Config) -> bool:
        """`src` has promised a higher term; answers whether this one is beaten.

        While it only asks, at once: a higher term of its own costs nothing. Once grants are on their way, only
        when no quorum is left: a late refusal by one voter must not undo an election that the others have made.
        """
        self._refused.add(seat(src.id))
        left = [m for m in electors(config) if m not in self._refused]
        return self.holder is None or not is_quorum(config, left)

    def has_quorum(self, config: Config) -> bool:
        return is_quorum(config, self._promised)
