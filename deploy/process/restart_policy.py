"""Restart policy of supervised processes. Pure: times are arguments."""

from __future__ import annotations

from collections import deque
from typing import Literal

from msgspec import Struct

Policy = Literal["never", "on-failure", "always"]
REFUSED_CODE = 2


class Restart(Struct, frozen=True, forbid_unknown_fields=True):
    """Restart policy for processes that end, except routers, which are always restarted."""

    policy: Policy = "on-failure"
    delay_s: float = 0.5
    """Delay [s] before the first restart; doubled for each further restart within the window."""
    delay_max_s: float = 10.0
    window_s: float = 60.0
    starts_max: int = 5
    """Maximum number of restarts within the window; at the next end the process is not restarted."""
    watchdog_s: float = 5.0
    """Time [s] without a sign of life after which a process counts as hung: it is killed, and then restarted."""


ROUTER = Restart(policy="always", delay_s=0.05, delay_max_s=2.0, window_s=60.0, starts_max=1_000_000)
"""Restart policy of routers: unlimited, since a machine without its router is isolated."""
RUN = Restart(policy="on-failure", delay_s=0.05, delay_max_s=2.0, window_s=60.0, starts_max=1_000_000)
"""Restart policy of the processes of `lfa run` that its scenario restarts: as often as needed, it ends with the run."""


class RestartDecision(Struct, frozen=True):
    """Decision on a restart: time `at` [s], None for never, and the state in one word."""

    at: float | None
    word: str


class RestartBackoff:
    """Restart backoff of one process, from its ends within the window."""

    def __init__(self, restart: Restart) -> None:
        self._restart = restart
        self._ends: deque[float] = deque()

    def ended(self, code: int, now: float) -> RestartDecision:
        """Return the decision after an end with `code` (as of `Popen`, negative for a signal) at `now` [s].

        Code 2 is a refusal, which a restart would repeat.
        """
        if not _again(self._restart.policy, code):
            return RestartDecision(None, "refused" if code == REFUSED_CODE else "ended" if code == 0 else "failed")
        while self._ends and self._ends[0] <= now - self._restart.window_s:
            self._ends.popleft()
        if len(self._ends) >= self._restart.starts_max:
            return RestartDecision(None, "failed")
        delay_s = min(self._restart.delay_s * 2.0 ** min(len(self._ends), 32), self._restart.delay_max_s)
        self._ends.append(now)
        return RestartDecision(now + delay_s, "waiting")

    def forget(self) -> None:
        """Clear the history, after a restart by an operator."""
        self._ends.clear()


def _again(policy: Policy, code: int) -> bool:
    if policy == "never" or code == REFUSED_CODE:
        return False
    return policy == "always" or code != 0
