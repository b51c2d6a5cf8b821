"""Which terms are believed (E26): numbers are plenty, but nobody may use them up.

The greatest number of a message is 2^53, and no term comes after it. A term up to `FREE` is believed at once, whatever
was known before: floors are wall clocks in milliseconds, and those may be wrong by decades. Above `FREE` the known
number grows by `RATE_HZ` at most. So a term that a robot made up costs the others one election and never the last one.
"""

from __future__ import annotations

from lfa.protocol.messages.consensus import LeaseBody, Nack, Prepare, Propose, Release

LAST = 2**53
"""Greatest number of a message: no term comes after it."""
FREE = 2**43
"""Greatest term number that is believed at once; as milliseconds since 1970 it is the year 2248."""
RATE_HZ = 1000.0
"""Growth [1/s] of term numbers above `FREE`, ten times that of the fastest elections."""
BURST = 1000
"""Growth above `FREE` that is believed at any time, besides `RATE_HZ`."""
FRESH = 2**40
"""Distance above `FREE` up to which a process believes that knows nothing there yet: 35 years at `RATE_HZ`."""
REACH = FREE + 2 * FRESH
"""Greatest number that a term comes to: a made-up one that was believed, and 35 years of elections after it. No process
knows a higher one, so none from the own gateway or agent is right either."""

_BINDING = (Prepare, Release)


def highest(body: LeaseBody) -> int:
    """Return the greatest term number by which a receiver of `body` would be bound; 0 if by none."""
    if isinstance(body, Propose):
        return max(body.term.n, body.config.version.term.n)
    if isinstance(body, Nack):
        return max(body.promised.n, body.config.version.term.n)
    return body.term.n if isinstance(body, _BINDING) else 0


class TermWindow:
    """Highest term number known to one process or gateway, and how far beyond it others are believed."""

    def __init__(self, known: int = 0) -> None:
        self.known = known
        self._since = 0.0
        """Time [s] at which a number above `FREE` was first known."""
        self._grown = 0

    def believes(self, number: int, now: float) -> bool:
        """Return True, and know `number` from now on, if it is not too far ahead at `now` [s]."""
        if number <= self.known:
            return True
        if self.known < FREE:
            if number > FREE + FRESH:
                return False
            self._since = now
        else:
            growth = number - self.known
            if self._grown + growth > BURST + RATE_HZ * (now - self._since):
                return False
            self._grown += growth
        self.known = number
        return True

    def know(self, number: int) -> None:
        """Know a number without a check: that of an own term, or one from the own gateway or agent."""
        self.known = max(self.known, number)
