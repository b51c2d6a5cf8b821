"""Progress of a campaign on stderr: a bar on a terminal, else a line every 10 s, and each failure as it comes."""

from __future__ import annotations

import sys
import time

from lfa.protocol.output import write_line

LINE_EVERY_S = 10.0
BAR_EVERY_S = 0.2
BAR_CELLS = 24
FAILURES_NAMED_MAX = 50
"""Number of failures that are named; further ones are only counted, and stand in the merged table."""


class CampaignProgress:
    """Count of the items done, with the rate of this process and the time that is left at that rate."""

    def __init__(self, total: int, before: int, said: str = "runs") -> None:
        """`before` of the `total` items were done by an earlier start."""
        self._total, self._before, self._said = total, before, said
        self._done = self.failed = 0
        self._since_s = self._shown_s = time.monotonic()
        self._live = sys.stderr is not None and sys.stderr.isatty()
        if before:
            self._line(f"{before} of {total} {said} are there already")

    def step(self, label: str, complaint: str) -> None:
        """Count an item; name it if it failed."""
        self._done += 1
        if complaint:
            self.failed += 1
            if self.failed <= FAILURES_NAMED_MAX:
                self._line(f"failed: {label}: {complaint}")
        now = time.monotonic()
        if now - self._shown_s >= (BAR_EVERY_S if self._live else LINE_EVERY_S):
            self._shown_s = now
            self._show(now)

    def counted(self) -> str:
        """Return how many items are done, and how many of those that were done here failed."""
        return f"{self._before + self._done} of {self._total} {self._said} are done, {self.failed} failed"

    def close(self) -> None:
        """Show the final state."""
        if self._done:
            self._show(time.monotonic())
        if self._live:
            write_line("", sys.stderr)

    def _show(self, now: float) -> None:
        text = so_far(self._before + self._done, self._total, self._done, now - self._since_s, self.failed, self._said)
        if self._live:
            print(f"\r\033[K{text}", end="", file=sys.stderr, flush=True)
        else:
            write_line(text, sys.stderr)

    def _line(self, text: str) -> None:
        if self._live:
            print("\r\033[K", end="", file=sys.stderr, flush=True)
        write_line(text, sys.stderr)


def so_far(done: int, total: int, done_here: int, seconds: float, failed: int, said: str = "runs") -> str:
    """Return the progress as text: a bar, counts, rate and time left [min:s]."""
    filled = BAR_CELLS * done // max(total, 1)
    rate = done_here / seconds if seconds > 0.0 else 0.0
    left = round((total - done) / rate) if rate > 0.0 else 0
    bar = "#" * filled + "." * (BAR_CELLS - filled)
    return (
        f"[{bar}] {done} of {total} {said}, {60.0 * rate:.0f} a minute, {left // 60}:{left % 60:02} left, "
        f"{failed} failed"
    )
