"""Search over seeds: schedules played, results summed up, and a schedule that fails made smaller."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from pathlib import Path

from msgspec import Struct

from lfa.deploy.fuzz.fault_injector import Played, play, play_whole
from lfa.deploy.fuzz.network import Trace
from lfa.deploy.fuzz.schedules import Schedule, draw, without
from lfa.deploy.fuzz.trace_text import columns, describe, said

Player = Callable[[Schedule, Trace | None], Played]

CHUNKS: dict[Player, int] = {play: 50, play_whole: 4}
"""Number of seeds per task of a worker process."""


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


def play_part(part: tuple[range, Player]) -> Tally:
    """Play the schedules of some seeds and return their sum."""
    seeds, player = part
    tally = Tally()
    for seed in seeds:
        played = player(draw(seed), None)
        failed = {seed: [said(v) for v in played.violations]} if played.violations else {}
        tally.add(Tally(1, played.elections, dict(played.counts), failed))
    return tally


def shrink(schedule: Schedule, name: str, player: Player = play) -> Schedule:
    """Return a schedule with fewer faults that still violates invariant `name`.

    Halves of the faults are left out first, then quarters, and so on down to single faults.
    """
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


def again(seed: int, player: Player) -> str:
    """Return the command line that runs a seed again."""
    return f"lfa fuzz {'--whole ' if player is play_whole else ''}--seed {seed} -v"


def explain(seed: int, player: Player) -> str:
    """Return the shrunk schedule of a failed seed with its trace and its violations, as text."""
    small = shrink(draw(seed), player(draw(seed), None).violations[0].name, player)
    lines: list[str] = []
    played = player(small, columns(lines, small))
    return "\n".join([describe(small), *lines, *(said(v) for v in played.violations)])


def write_explanation(seed: int, text: str, out: Path, player: Player) -> Path:
    """Write the explanation of a failed seed into the folder `out` and return its path."""
    out.mkdir(parents=True, exist_ok=True)
    path = out / f"{'whole-' if player is play_whole else ''}{seed}.txt"
    path.write_text(f"{text}\n", encoding="utf-8")
    return path
