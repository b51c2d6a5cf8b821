"""How one process stops leading (E4): from its last command until it may say that its term moves nothing any more."""

from __future__ import annotations

from lfa.protocol.lease.timing import CLOCK_RATE_ERROR
from lfa.protocol.messages.consensus import Propose, Term

NEVER = float("inf")
SLOWEST = (1.0 + CLOCK_RATE_ERROR) / (1.0 - CLOCK_RATE_ERROR)
"""How many seconds of the fastest clock one second of the slowest may last."""


class PendingRelease:
    def __init__(self, deadman_s: float) -> None:
        self.closing = False
        """The process was told to end."""
        self.commanded_at = float("-inf")
        """When the last command as leader was sent."""
        self.unreleased: Term | None = None
        """The term given up whose RELEASE waits for the own gateway, until `release_at` at most."""
        self.release_at = NEVER
        self.transfer_proposal: Propose | None = None
        """What is handed over instead of a RELEASE, once we have stopped."""
        self._deadman_s = deadman_s

    @property
    def at_rest_at(self) -> float:
        """From when on no gateway obeys the last command sent as leader, by its age alone."""
        return self.commanded_at + self._deadman_s * SLOWEST

    def begin(self, term: Term, now: float) -> None:
        self.unreleased, self.release_at = term, max(now, self.at_rest_at)

    def end(self) -> tuple[Term | None, Propose | None]:
        """The gateway refuses the term, or its last command is too old: what was given up, and what is handed over."""
        done = self.unreleased, self.transfer_proposal
        self.unreleased, self.transfer_proposal, self.release_at = None, None, NEVER
        return done
