"""The interface of an engine: start, stop, states and logs of one machine's processes.

Both engines pass `tests/deploy/fleet/engine/test_engines.py`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol

from msgspec import Struct

from lfa.deploy.process.identity import Identity
from lfa.protocol.messages.fleet import ProcessReport

ROUTER_FIRST_S = 3.0
"""Time [s] for which the other processes wait at the start for the router, so that they need not retry."""


class KnownProcess(Struct, frozen=True):
    """A process as an earlier incarnation wrote it down."""

    name: str
    identity: Identity
    starts: int
    began_ms: int


class Waitable(Protocol):
    def fileno(self) -> int: ...


class LogSource(Protocol):
    """Last lines of one process's log, then the new ones."""

    def prolong(self, now: float) -> None:
        """Follow the log for some more seconds."""

    def over(self, now: float) -> bool: ...

    def take(self, now: float) -> tuple[str, ...]:
        """Return the lines since the last call."""


class ProcessEngine(Protocol):
    """Engine of one machine. `now` is the supervisor's clock [s]."""

    @property
    def bound(self) -> bool:
        """True: the processes belong to another engine than the supervisor, and do not end with it."""

    @property
    def names(self) -> Sequence[str]:
        """Names of the processes, the router first."""

    @property
    def wakes(self) -> Sequence[Waitable]:
        """Sockets whose arrivals make a step due."""

    def start(self, now: float, known: Sequence[KnownProcess] = ()) -> None:
        """Begin: adopt what runs already, with what an earlier incarnation knew of it; start the rest with `step`."""

    def step(self, now: float, *, router_up: bool) -> bool:
        """Do what is due, such as a restart; return True when a state changed. Raises Refused for a router that may
        never start.
        """

    def restart(self, name: str, now: float) -> None:
        """End the process in order, and start it again."""

    def stop(self, now: float, *, router: bool) -> None:
        """End all processes but the router in order, or the router."""

    def states(self, now: float) -> tuple[ProcessReport, ...]: ...

    def logs(self, name: str, lines: int, now: float) -> LogSource: ...

    def known(self) -> Iterator[KnownProcess]:
        """Yield the running processes, for a later incarnation."""

    def kill(self) -> None:
        """Kill all processes: for a start that is refused."""

    def close(self) -> None:
        """Free the sockets."""
