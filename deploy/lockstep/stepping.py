"""How a lockstep run goes on in time: as fast as it can or at a given speed, and where it stands until `lfa step`."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, isfinite

from msgspec import Struct

from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.names import whole_number

STEP = "step"
"""Operator command: grant `ticks` more ticks; without a number, go on without an end."""
STEPPED = "stepped"
"""Event that answers: where the run stands, or from where it goes on."""
SLEEP_S_MAX = 0.1
TICKS_MAX = 10**9
MAX = "max"


class Pace(Struct, frozen=True):
    """Speed over real time (inf: as fast as it can), and the tick at which the run first stands (None: it does not)."""

    speed: float = inf
    stands_at: int | None = None


def pace_of(speed: str | None, pause: bool, step: str | None) -> Pace:
    """Return the pace of the options `--speed`, `--pause` and `--step`. Raises Refused."""
    ticks = 0 if pause else None
    if step is not None:
        ticks = ticks_of("--step", step)
    return Pace(inf if speed in (None, MAX) else _number(str(speed)), ticks)


def ticks_of(what: str, text: str) -> int:
    """Return a number of ticks. Raises Refused."""
    ticks = whole_number(text)
    if ticks is None or not 1 <= ticks <= TICKS_MAX:
        raise Refused(f"{what} {text}: must be a whole number of ticks, 1 to {TICKS_MAX}")
    return ticks


def _number(text: str) -> float:
    try:
        speed = float(text)
    except ValueError:
        speed = -1.0
    if not (isfinite(speed) and speed > 0.0):
        raise Refused(f"--speed {text}: must be a number above 0, as 1 for real time, or {MAX}")
    return speed


class Stepping:
    """Where the run may go on to, and how fast; `tick_s` is the length of a tick [s]."""

    def __init__(self, pace: Pace, tick_s: float) -> None:
        self._speed = pace.speed
        self._tick_s = tick_s
        self._tick = pace.stands_at
        self._began_at: float | None = None
        self._from_s = 0.0

    @property
    def until(self) -> float:
        """Virtual time [s] at which the run stands next; inf: it does not."""
        return inf if self._tick is None else self._tick * self._tick_s

    @property
    def tick(self) -> int:
        """Tick at which the run stands or stood."""
        return self._tick or 0

    def go_on(self, ticks: int | None) -> None:
        """Let the run go on by so many ticks; None: without an end."""
        self._tick = None if ticks is None else self.tick + ticks
        self._began_at = None

    def hold(self, now: float, over: Callable[[], bool]) -> None:
        """Wait until this machine's clock has come as far as the virtual time `now` [s] at the given speed."""
        if not isfinite(self._speed):
            return
        if self._began_at is None:
            self._began_at, self._from_s = clock.now(), now
        due = self._began_at + (now - self._from_s) / self._speed
        while (left_s := due - clock.now()) > 0.0 and not over():
            clock.sleep(min(left_s, SLEEP_S_MAX))
