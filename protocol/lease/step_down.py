"""Step-down of a leader (E4): from its last command until it may send the RELEASE of its term."""

from __future__ import annotations

from lfa.protocol.lease.timing import CLOCK_RATE_ERROR
from lfa.protocol.messages.consensus import Propose, Term

NEVER = float("inf")
SLOWEST = (1.0 + CLOCK_RATE_ERROR) / (1.0 - CLOCK_RATE_ERROR)
"""Maximum duration, in seconds of the fastest clock, of one second of the slowest clock."""


class PendingRelease:
    """A lease that is given up, from the last command as leader until RELEASE or the transfer proposal is sent."""

    def __init__(self, deadman_s: float) -> None:
        self.closing = False
        """True if the process has been asked to end."""
        self.commanded_at = float("-inf")
        """Time [s] at which the last command as leader was sent."""
        self.unreleased: Term | None = None
        """Term given up, whose RELEASE waits for the own gateway, until `release_at` at most."""
        self.release_at = NEVER
        self.transfer_proposal: Propose | None = None
        """Transfer proposal to send after the stop instead of a RELEASE (E16)."""
        self._deadman_s = deadman_s

    @property
    def at_rest_at(self) -> float:
        """Time [s] from which no gateway obeys the last command as leader, because of its age alone."""
        return self.commanded_at + self._deadman_s * SLOWEST

    def begin(self, term: Term, now: float) -> None:
        """Give up `term` at `now` [s]."""
        self.unreleased, self.release_at = term, max(now, self.at_rest_at)

    def end(self) -> tuple[Term | None, Propose | None]:
        """Complete the step-down; return the term given up and the transfer proposal, each None if there is none."""
        done = self.unreleased, self.transfer_proposal
        self.unreleased, self.transfer_proposal, self.release_at = None, None, NEVER
        return done
