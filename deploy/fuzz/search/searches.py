"""Search over seeds: schedules played, results summed up, and a schedule that fails made smaller."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Literal

from msgspec import Struct, structs

from lfa.deploy.analysis.causes.broken_rules import lines as chain_lines
from lfa.deploy.fuzz.fault_injector import Played, play, play_whole
from lfa.deploy.fuzz.fleet_stop.stop_play import play_stops
from lfa.deploy.fuzz.fleet_stop.stop_schedules import KINDS as STOP_KINDS
from lfa.deploy.fuzz.fleet_stop.stop_schedules import draw_stop_schedule
from lfa.deploy.fuzz.network import Trace
from lfa.deploy.fuzz.schedules import KINDS, Schedule, draw, draw_whole, without
from lfa.deploy.fuzz.search import guided, systematic
from lfa.deploy.fuzz.search.lagging import draw_lagging
from lfa.deploy.fuzz.search.trace_text import columns, describe, said

Player = Callable[[Schedule, Trace | None], Played]

Kind = Literal["drawn", "lagging", "systematic", "guided", "stops"]


class Search(Struct, frozen=True):
    """Schedules that a search plays, each by its seed: on leases alone, on the fleet stop, or `whole` on agents."""

    kind: Kind = "drawn"
    whole: bool = False

    @property
    def player(self) -> Player:
        return play_stops if self.kind == "stops" else play_whole if self.whole else play

    @property
    def chunk(self) -> int:
        """Number of seeds per task of a worker process; a guided search goes by islands."""
        return guided.ISLAND if self.kind == "guided" else 4 if self.whole else 500 if self.kind == "stops" else 50

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of fault that its schedules may have."""
        return STOP_KINDS if self.kind == "stops" else (*KINDS, "lag") if self.kind == "lagging" else KINDS

    @property
    def options(self) -> str:
        """Options of `lfa fuzz` for this search, each with a blank behind it."""
        return ("--whole " if self.whole else "") + ("" if self.kind == "drawn" else f"--{self.kind} ")

    def schedule(self, seed: int) -> Schedule:
        """Return the schedule of a seed; of a guided search by playing its island up to it."""
        if self.kind == "guided":
            return next(played.schedule for _, played in guided.evolve(range(seed, seed + 1), self.player))
        if self.kind == "systematic":
            return systematic.schedule(seed)
        if self.kind == "lagging":
            return draw_lagging(seed)
        if self.kind == "stops":
            return draw_stop_schedule(seed)
        return draw_whole(seed) if self.whole else draw(seed)

    def played(self, seeds: range) -> Iterator[tuple[int, Played]]:
        """Play the schedules of `seeds` and yield each seed with its result."""
        if self.kind == "guided":
            yield from guided.evolve(seeds, self.player)
            return
        for seed in seeds:
            yield seed, self.player(self.schedule(seed), None)


class Tally(Struct):
    """Sum of the results of several seeds."""

    seeds: int = 0
    elections: int = 0
    faults: dict[str, int] = {}
    failed: dict[int, list[str]] = {}
    """Violations by seed."""

    def add(self, other: Tally) -> None:
        """Add the results of other seeds."""
        self.seeds += other.seeds
        self.elections += other.elections
        self.faults = dict(Counter(self.faults) + Counter(other.faults))
        self.failed = {**self.failed, **other.failed}


def play_part(part: tuple[range, Search]) -> Tally:
    """Play the schedules of some seeds and return their sum."""
    seeds, search = part
    tally = Tally()
    for seed, played in search.played(seeds):
        tally.add(tally_of_seed(seed, played))
    return tally


def tally_of_seed(seed: int, played: Played) -> Tally:
    """Return the result of one seed."""
    failed = {seed: [said(v) for v in played.violations]} if played.violations else {}
    return Tally(1, played.elections, dict(played.counts), failed)


def shrink(schedule: Schedule, name: str, player: Player = play) -> Schedule:
    """Return a schedule with fewer faults that still violates invariant `name`.

    Halves of the faults are left out first, then quarters, and so on down to single faults; then delayed messages,
    tricks, and of the fleet stop alone calls of operators.
    """
    schedule = _fewer_faults(schedule, name, player)
    for field in ("held", "tricks", *(["stops"] if player is play_stops else [])):
        for one in getattr(schedule, field):
            tried = structs.replace(schedule, **{field: tuple(o for o in getattr(schedule, field) if o != one)})
            if any(v.name == name for v in player(tried, None).violations):
                schedule = tried
    return schedule


def _fewer_faults(schedule: Schedule, name: str, player: Player) -> Schedule:
    size = max(len(schedule.faults) // 2, 1)
    while True:
        index, smaller = 0, False
        while index < len(schedule.faults):
            tried = without(schedule, *range(index, index + size))
            if any(v.name == name for v in player(tried, None).violations):
                schedule, smaller = tried, True
            else:
                index += size
        if size == 1 and not smaller:
            return schedule
        size = max(size // 2, 1)


def again(seed: int, search: Search) -> str:
    """Return the command line that runs a seed again."""
    return f"lfa fuzz {search.options}--seed {seed} -v"


def explain(seed: int, search: Search) -> str:
    """Return the shrunk schedule of a failed seed with its trace and its violations, as text."""
    schedule, player = search.schedule(seed), search.player
    small = shrink(schedule, player(schedule, None).violations[0].name, player)
    lines: list[str] = []
    played = player(small, columns(lines, small))
    causes = [] if played.broken is None else chain_lines(played.broken)
    return "\n".join([describe(small), *lines, *(said(v) for v in played.violations), *causes])


def write_explanation(seed: int, text: str, out: Path, search: Search) -> Path:
    """Write the explanation of a failed seed into the folder `out` and return its path."""
    out.mkdir(parents=True, exist_ok=True)
    path = out / f"{search.options.replace('--', '').replace(' ', '-')}{seed}.txt"
    path.write_text(f"{text}\n", encoding="utf-8")
    return path
