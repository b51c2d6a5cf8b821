"""`lfa bench motion`: whole teams in virtual time through every shipped scenario, and through unknown ground.

Each case is one scenario over several seeds, or random pairs of start and goal on a map; a run is good when it ends at
its goal without contact, without a broken invariant and with nobody left behind. One that is not good says why.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Sequence
from functools import partial
from math import hypot
from pathlib import Path
from random import Random

from deploy.bench.rows import Case, Quantity, measured, select, show
from deploy.look.summary import Summary
from protocol.mission import Refused

SEEDS = 3
PAIRS = 20
PAIRS_GOOD = 18
PAIR_M, CLEAR_M = 8.0, 0.45
"""Least distance of start and goal, and least clearance of both."""
TRIES_MAX = 4000
SHIPPED_MAP = Path("maps") / "rooms.yaml"


def cases(seeds: int) -> list[Case]:
    from world.scenario import shipped

    all_good = Quantity("good", "runs", float(seeds), "at least")
    runs = [Case(f"scenario/{name}", (all_good,), partial(scenario_good, name, seeds)) for name in shipped()]
    some_good = Quantity(f"good of {PAIRS}", "runs", float(PAIRS_GOOD), "at least")
    return [*runs, Case("unknown/rooms", (some_good,), partial(pairs_good, PAIRS))]


def run(as_json: bool, rows: str = "scenario/*", jobs: int = 1, seeds: int = SEEDS) -> int:
    """0 when every chosen row holds, else 1. `rows` is a glob over row names."""
    return show(measured(select(cases(seeds), rows), jobs, rows), as_json)


def scenario_good(name: str, seeds: int) -> tuple[float]:
    """How many of the seeds from 1 end well."""
    return (float(sum(_good(name, seed, ()) for seed in range(1, seeds + 1))),)


def pairs_good(count: int) -> tuple[float]:
    """How many random pairs on the shipped map end well."""
    return (float(sum(_good("explore", number, sets) for number, sets in enumerate(pairs(count), start=1))),)


def pairs(count: int) -> list[tuple[str, str]]:
    """`start` and `goal` of so many pairs on free ground that a chain can be laid out at, as `--set` takes them."""
    from world import maps
    from world.scenario import SCENARIOS, load

    drawn = maps.read(SCENARIOS / SHIPPED_MAP)
    room, chance, found = maps.Room(drawn), Random("pairs"), list[tuple[str, str]]()
    height_m, width_m = (drawn.resolution_m * cells for cells in drawn.occupied.shape)
    for _ in range(TRIES_MAX):
        if len(found) == count:
            break
        a, b = (drawn.to_map(chance.random() * width_m, chance.random() * height_m) for _ in range(2))
        if hypot(a[0] - b[0], a[1] - b[1]) < PAIR_M or min(room.clearance_m(*a), room.clearance_m(*b)) < CLEAR_M:
            continue
        sets = (f"start={a[0]:.2f},{a[1]:.2f}", f"goal={b[0]:.2f},{b[1]:.2f}")
        try:
            load("explore", sets)
        except Refused:
            continue
        found.append(sets)
    return found


def _good(name: str, seed: int, sets: Sequence[str]) -> bool:
    from deploy.run.faults import parse_all
    from deploy.run.simulate import run as simulate
    from world.scenario import load

    scenario = load(name, sets)
    folder = Path(tempfile.mkdtemp(prefix="lfa-motion-"))
    try:
        summary = simulate(scenario, seed, folder / "run", parse_all(scenario.mission, scenario.faults, ())).summary
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    wrong = complaint(summary)
    options = "".join(f" --set {one}" for one in sets)
    print(f"lfa sim {name} --seed {seed}{options}: {wrong or 'ok'}", file=sys.stderr, flush=True)
    return wrong is None


def complaint(summary: Summary) -> str | None:
    """Why a run is not good; None when it is."""
    contacts = sum(robot.contacts for robot in summary.robots)
    if summary.exit_code != 0:
        return summary.reason or ", ".join(one.name for one in summary.assertions if not one.ok)
    if summary.violations:
        return ", ".join(one.invariant for one in summary.violations)
    if summary.left_behind:
        return f"left behind: {summary.left_behind}"
    return f"{contacts} contacts" if contacts else None
