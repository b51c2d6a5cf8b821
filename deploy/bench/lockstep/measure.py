"""Rows of `lfa bench lockstep`: one run of four robots, as processes in lockstep and by `lfa sim`."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

from msgspec.structs import replace

from lfa.deploy.bench.harness.rows import Case, Quantity, measured, select, show
from lfa.deploy.lockstep import run as lockstep
from lfa.deploy.lockstep.diff_command import compare
from lfa.deploy.lockstep.stepping import Pace
from lfa.deploy.run import simulate
from lfa.deploy.run.finish import Ended
from lfa.world.description.load import load

SCENARIO, ROBOTS = "straight", 4
SIMULATED_S = 20.0
FACTOR = 20.0
"""Least speed of processes in lockstep, in times of real time."""
Play = Callable[[Path], Ended]


def run(as_json: bool, rows: str = "*", seeds: int = 1) -> int:
    """Print the rows; return 0 if all hold, else 1. `seeds`: number of runs, from seed 1."""
    return show(measured(select(cases(seeds), rows), 1, rows), as_json)


def cases(seeds: int) -> list[Case]:
    """Return the runs to measure."""
    quantities = (
        Quantity("speed, in times of real time", "1", FACTOR, "at least"),
        Quantity("processor time of all processes", "s/s"),
        Quantity("speed of lfa sim", "1"),
        Quantity("processor time of lfa sim", "s/s"),
        Quantity("ticks that differ", "1", 0.0),
    )
    return [Case(f"{ROBOTS} robots, seed {seed}", quantities, partial(_measure, seed)) for seed in range(1, seeds + 1)]


def _measure(seed: int) -> list[float]:
    """Run the scenario both ways, and return the values of a case."""
    scenario = replace(load(SCENARIO, (), ROBOTS), time_limit_s=SIMULATED_S)
    with tempfile.TemporaryDirectory(prefix="lfa-") as place:
        apart, together = Path(place) / "lockstep", Path(place) / "sim"
        values = [
            *_timed(apart, lambda folder: lockstep.run(scenario, seed, folder, (), Pace())),
            *_timed(together, lambda folder: simulate.run(scenario, seed, folder)),
        ]
        found = compare(apart, together)
        return [*values, 0.0 if found.tick is None else float(min(found.ticks) - found.tick)]


def _timed(folder: Path, play: Play) -> tuple[float, float]:
    """Return speed and processor time [s] of a run, both for each second of virtual time."""
    before_s = _used_s()
    summary = play(folder).summary
    return summary.real_time_factor, (_used_s() - before_s) / SIMULATED_S


def _used_s() -> float:
    """Return the processor time [s] of this process and of its children that have ended."""
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system
